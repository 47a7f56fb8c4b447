"""A process that has imported `ilc` and forks for each command: see warm_fixture.

``serve SOCKET`` is the server, and ``SOCKET WORDS`` has it run ``ilc WORDS`` in this process's
folder, environment and descriptors.
"""

from __future__ import annotations

import atexit
import json
import os
import socket
import sys
import threading
from pathlib import Path

#: Larger than the words and the environment of any command.
REQUEST_BYTES = 1 << 17


def serve(path: str) -> int:
    """Fork for each request, until input ends; in a command, return its exit code."""
    import gc
    import selectors
    import signal

    from ilc_rt.cli import application

    application()
    # Imported by commands when they need them.
    import matplotlib.figure  # noqa: F401
    import nicegui  # noqa: F401
    import psycopg  # noqa: F401
    import zenoh  # noqa: F401

    gc.freeze()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(path)
    listener.listen()
    print("ready", flush=True)
    ready = selectors.DefaultSelector()
    ready.register(listener, selectors.EVENT_READ)
    ready.register(sys.stdin, selectors.EVENT_READ)
    while True:
        for key, _ in ready.select():
            if key.fileobj is sys.stdin:
                return 0
            if key.fileobj is listener:
                client, _ = listener.accept()
                request, descriptors, _, _ = socket.recv_fds(client, REQUEST_BYTES, 3)
                pid = os.fork()
                if pid == 0:
                    ready.close()
                    listener.close()
                    client.close()
                    end(command(json.loads(request), descriptors))
                for descriptor in descriptors:
                    os.close(descriptor)
                ended = os.pidfd_open(pid)
                ready.register(ended, selectors.EVENT_READ, (pid, ended, client))
                ready.register(client, selectors.EVENT_READ, (pid, ended, client))
                continue
            pid, ended, client = key.data
            if key.fileobj is client:
                # Its end, as nothing else is sent: the program that asked has gone.
                os.kill(pid, signal.SIGKILL)
            _, status = os.waitpid(pid, 0)
            ready.unregister(ended)
            ready.unregister(client)
            os.close(ended)
            client.sendall(str(os.waitstatus_to_exitcode(status)).encode())
            client.close()
            break


def command(request: dict, descriptors: list[int]) -> int:
    """Become the command that was asked for, and return its exit code."""
    from ilc_rt.cli import main

    for number, descriptor in enumerate(descriptors):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv = ["ilc", *request["words"]]
    return main()


def end(code: int) -> None:
    """End this process as Python does, but leave its modules alone.

    Taking them apart takes longer than most commands.
    """
    for thread in threading.enumerate():
        if thread is not threading.main_thread() and not thread.daemon:
            thread.join()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def ask(path: str, words: list[str], folder: str, environment: dict, descriptors: list[int],
        timeout_s: float | None = None) -> int:  # fmt: skip
    """Have a command run, and return its exit code."""
    request = {"words": words, "folder": folder, "environment": environment}
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.settimeout(timeout_s)
        server.connect(path)
        socket.send_fds(server, [json.dumps(request).encode()], descriptors)
        return int(server.recv(16))


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        sys.exit(serve(sys.argv[2]))
    sys.exit(ask(sys.argv[1], sys.argv[2:], str(Path.cwd()), dict(os.environ), [0, 1, 2]))
