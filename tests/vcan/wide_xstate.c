/*
 * Lets User-Mode Linux run on processors whose register state is larger than it was built for.
 *
 * Debian's UML reserves 2696 bytes for the x86 extended state of a process (up to AVX-512 and PKRU).
 * Where the processor has more (AMX tiles, for one), the host refuses PTRACE_SETREGSET for any other
 * length than its own, and UML dies at its first process. Preloaded, this ptrace() completes what UML
 * hands over with the rest of the state as the host has it, which UML's processes never touch.
 * Where the lengths agree nothing changes.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

enum { STATE_MAX_BYTES = 32768 };

typedef long (*ptrace_fn)(int request, ...);

long ptrace(enum __ptrace_request request, ...)
{
	static ptrace_fn host_ptrace;
	if (host_ptrace == NULL)
		host_ptrace = (ptrace_fn)dlsym(RTLD_NEXT, "ptrace");

	va_list arguments;
	va_start(arguments, request);
	int pid = va_arg(arguments, int);
	void *address = va_arg(arguments, void *);
	void *data = va_arg(arguments, void *);
	va_end(arguments);

	if (request == PTRACE_SETREGSET && (long)address == NT_X86_XSTATE) {
		static char state[STATE_MAX_BYTES];
		struct iovec given = *(struct iovec *)data;
		struct iovec whole = { state, sizeof state };

		if (host_ptrace(PTRACE_GETREGSET, pid, address, &whole) == 0 && whole.iov_len > given.iov_len) {
			memcpy(state, given.iov_base, given.iov_len);
			return host_ptrace(request, pid, address, &whole);
		}
	}
	return host_ptrace(request, pid, address, data);
}
