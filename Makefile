# Two commands matter: `make demo` and `make test`. Both do all their own set-up.

# `make DEV=1 …` is for development: what is changed compiles in seconds, less optimised, in a target
# folder of its own.
ifdef DEV
export CARGO_PROFILE_RELEASE_INCREMENTAL   := true
export CARGO_PROFILE_RELEASE_OPT_LEVEL     := 1
export CARGO_PROFILE_RELEASE_CODEGEN_UNITS := 256
export CARGO_TARGET_DIR                    := $(abspath $(or $(CARGO_TARGET_DIR),target))/dev
endif

VENV    := .venv
BIN     := $(VENV)/bin
TARGET  := $(or $(CARGO_TARGET_DIR),target)
SOURCES := $(shell find crates sim python papers -name '*.rs' -o -name '*.py' -o -name '*.pyi' -o -name '*.toml') \
           Cargo.toml Cargo.lock pyproject.toml README.md
# More than half of the time Python tests wait for a process or for time to pass. A file with costly fixtures of its own
# is kept together by the mark xdist_group.
JOBS    := $(shell expr 3 \* $$(nproc))

# Every worker of pytest would compile every test anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help build derived underived demo gallery test test-rust test-python fuzz soak trials check fmt lint docs bench rt instructions rtsan rt-page deb vcan clean

help: ## List the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(BIN)/python:
	python3 -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip

$(VENV)/.tools: pyproject.toml | $(BIN)/python
	$(BIN)/pip install --quiet "maturin>=1.16,<2"
	@touch $@

$(VENV)/.built: $(SOURCES) $(VENV)/.tools
	cargo build --release --workspace --bins
	rm -rf build/wheels build/data
	install -D -m 755 -t build/data/scripts $(TARGET)/release/ilc-rt $(TARGET)/release/ilc-sim
	$(BIN)/maturin build --quiet --release --compression-level 9 --out build/wheels
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir build/wheels ./papers
	$(BIN)/pip install --quiet --force-reinstall --no-deps build/wheels/*.whl
	$(BIN)/pip install --quiet build/wheels/*.whl
	@touch $@

$(VENV)/.test: $(VENV)/.built
	wheel=$$(ls build/wheels/ilc_rt-*.whl) && $(BIN)/pip install --quiet "$$wheel[test]"
	@touch $@

$(VENV)/.docs: $(VENV)/.built
	wheel=$$(ls build/wheels/ilc_rt-*.whl) && $(BIN)/pip install --quiet "$$wheel[docs]"
	@touch $@

$(VENV)/.bench: $(VENV)/.built
	wheel=$$(ls build/wheels/ilc_rt-*.whl) && $(BIN)/pip install --quiet "$$wheel[bench]"
	@touch $@

build: $(VENV)/.built ## Build the binaries and the Python package into .venv

derived: export ILC_DERIVE = 1
derived: underived ## Write the files and tables that derive from the source

underived: $(VENV)/.test
	cargo test --release --workspace --quiet --test derived
	$(BIN)/python -m pytest -q tests/python/test_derived.py tests/python/test_theory.py

demo: build ## Ten runs on simulated drives, the error falling, and a report
	$(BIN)/ilc demo

gallery: build ## The papers, computed again: docs/gallery, pages and figures
	mkdir -p docs/gallery
	$(BIN)/ilc reproduce all --json docs/gallery/figures.json --report docs/gallery

# Every part waits a lot: they fill each other's gaps. The tests in Rust compute most and wait least, so they take what
# the others leave.
test: $(VENV)/.test $(VENV)/.docs ## Everything that can fail, on every transport
	+$(MAKE) --no-print-directory --jobs 3 --keep-going test-rust test-python vcan

test-rust: ## Rust tests
	@if cargo nextest --version >/dev/null 2>&1; then set -x; \
	  nice -n 3 cargo nextest run --release --workspace --no-fail-fast; \
	else set -x; nice -n 3 cargo test --release --workspace --no-fail-fast; fi
	cargo test --release --workspace --doc

test-python: $(VENV)/.test $(VENV)/.docs ## Python tests
	cargo build --release --workspace --example bus_echo
	$(BIN)/python -m pytest -q --numprocesses $(JOBS) --dist loadgroup

fuzz: $(VENV)/.test ## New problems for FUZZ_S seconds (60): property tests, readers, the border to Python
	FUZZ_S="$(FUZZ_S)" FUZZ_SEED="$(FUZZ_SEED)" $(BIN)/python tests/fuzz/run.py

soak: $(VENV)/.test ## Ten million ticks, then a cell by the clock for SOAK_S seconds (1200): nothing may grow or stop
	cargo test --release --workspace --test no_alloc -- --ignored --nocapture
	$(BIN)/python tests/soak/endurance.py --seconds "$(or $(SOAK_S),1200)"

trials: $(VENV)/.test ## Kills, full disks, strangers and a stalling computer, TRIALS times (20) as many: long, with a tally
	ILC_TRIALS="$(or $(TRIALS),20)" $(BIN)/python -m pytest -q tests/python/test_trials.py
	$(BIN)/python tests/soak/demo.py stalls --times 10
	$(BIN)/python tests/soak/demo.py load --times 40
	$(BIN)/python tests/soak/demo.py kills --times 20

vcan: $(VENV)/.test ## The bus contract, python-canopen and the main job on a real vcan0
	tests/vcan/job

check: fmt lint test ## All that a change needs before review

fmt: $(VENV)/.test ## Format
	cargo fmt --all
	$(BIN)/ruff format python papers tests examples docs/conf.py docs/tutorial

lint: $(VENV)/.test docs underived ## Formatting, lints, types, layers, language, derived files, documentation
	cargo fmt --all --check
	cargo clippy --release --workspace --all-targets -- -D warnings
	$(BIN)/ruff format --check python papers tests examples docs/conf.py docs/tutorial
	$(BIN)/ruff check python papers tests examples docs/conf.py docs/tutorial
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest ilc_rt._native
	$(BIN)/lint-imports
	$(BIN)/python tests/lint/language.py

docs: $(VENV)/.test $(VENV)/.docs ## The documentation site in build/docs, with warnings denied
	RUSTDOCFLAGS="-D warnings" cargo doc --release --workspace --no-deps
	$(BIN)/python -m sphinx --quiet -E --fail-on-warning --keep-going -d build/doctrees -c docs . build/docs
	rm -rf build/docs/rust
	$(BIN)/python -m pytest -q tests/site
	cp -r $(TARGET)/doc build/docs/rust

bench: $(VENV)/.bench ## Speed, as ratios; writes docs/benchmarks.md
	rm -rf $(abspath $(TARGET))/criterion
	CRITERION_HOME=$(abspath $(TARGET))/criterion \
	  cargo bench --workspace --bench main_job --bench learning --bench constrained --bench relevance --bench trajectory
	CRITERION_HOME=$(abspath $(TARGET))/criterion $(BIN)/python benchmarks/report.py

rt: build ## What is promised of the tick: no allocation, exact repetition; and this machine's punctuality
	cargo nextest run --release --workspace -E 'binary(no_alloc) | binary(no_alloc_learning) | binary(lockstep)'
	$(BIN)/ilc-rt latency --seconds 5

instructions: $(VENV)/.built ## Instructions of a tick by callgrind (Debian: valgrind), beside the stored figures
	$(BIN)/python benchmarks/instructions.py

# The sanitizer belongs to the compiler, but its switch is not stable yet. Build scripts must not be built
# with it, hence --target.
rtsan: ## The tick under LLVM's RealtimeSanitizer: no allocation, lock, sleep or system call
	RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=realtime --cfg rtsan" CARGO_PROFILE_RELEASE_OPT_LEVEL=1 \
	CARGO_TARGET_DIR=$(abspath $(TARGET))/rtsan \
	  cargo test --release --package ilc-tests --test no_alloc --target $$(rustc --print host-tuple)

rt-page: build ## Measure this computer's punctuality, RT_SECONDS (20) a part, and write its page into docs/machines
	$(BIN)/python benchmarks/machine_page.py

deb: build ## The Debian package of the two programs, in build/
	packaging/deb $(TARGET)/release build

clean: ## Remove what was built
	rm -rf build $(VENV)
	cargo clean
