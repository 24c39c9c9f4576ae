# `make help` lists what there is; the text behind ## is what it prints. Times are those of a fresh clone on
# two cores with two parts at a time; docs/CHECKS.md has them exactly.

CARGO ?= cargo
PYTHON ?= python3
export SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)
ifneq ($(words $(CURDIR)),1)
$(error make does not work in a folder with spaces in its path: $(CURDIR))
endif
# For Miri and the fuzzers. Raise it in a commit of its own; rust-toolchain.toml pins stable.
NIGHTLY := nightly-2026-05-20
# The boards of the tests have a Cortex-M4.
BOARD := thumbv7em-none-eabihf
BUILT := $(or $(abspath $(CARGO_TARGET_DIR)),$(CURDIR)/target)
DEBUG := $(BUILT)/debug

VENV := $(CURDIR)/.venv
BENCH_VENV := $(CURDIR)/.venv-bench

# Which tests of a part to run: arguments of cargo test for unit and miri; of pytest, in
# the folder of the tests, for e2e, python, pages and firmware-test.
T =
# LONG=1: also what takes long, in e2e, python, pages, firmware-test and browser.
export LONG
# Tests in Rust that take seconds. `make check` leaves them out, `make test` runs them.
QUICK := $(addprefix --skip=,mutants suite nothing_grows stood_still every_promise every_header every_target_stands)
# AGAIN=1: the tests of pytest and Playwright that failed in the last run, or all if that did not come so far.
FAILED = $(if $(AGAIN),--last-failed)
# Tests that pytest and cargo run at a time. Most of them wait.
WORKERS ?= 4
export RUST_TEST_THREADS ?= 16
PYTEST_FLAGS = -q -rfEs -n $(WORKERS) --dist worksteal -o cache_dir=$(CURDIR)/target/parts/$@.cache $(FAILED) \
	-p measured $(if $(AGAIN),,--junitxml=$(CURDIR)/target/parts/$@.xml)
e2e ros2 python pages firmware-test: export PYTHONPATH = $(CURDIR)/tests
# The package and its plugin may be installed anew meanwhile.
PYTEST = $(VENV)/bin/python -m pytest -p no:motorlink $(PYTEST_FLAGS)

# For all that the tests build, clippy is the compiler: so it needs no build of its own. It tells warnings again
# each time; `lint` fails if there is one.
lint unit e2e ros2 package python pages browser ffi-test firmware-test test-socketcan: export RUSTC_WORKSPACE_WRAPPER = clippy-driver
# What maturin would write for the package, so that it does not build PyO3 again, nor `cargo test` after it.
lint unit e2e ros2 package python pages browser ffi-test firmware-test test-socketcan: export PYO3_CONFIG_FILE = $(CURDIR)/bindings/python/pyo3.txt

# The program with the features of the whole workspace: built once for all parts.
PROGRAM = $(CARGO) build --workspace --all-features --bin motorlink --example machine --example rmd_frames --example wireshark_frames --locked

# The parts of `make test`: two run at a time, in this order. The page is a part of the program, and `probe`
# needs the lock of cargo for a moment only: they come before `lint`, which compiles for all others. Those that
# wait for real time run beside one another; emulators delay other processes by up to 2.5 s.
TEST_PARTS := web-test probe lint unit e2e browser python pages ffi-test firmware-test test-socketcan cost determinism
# Those of `make verify` only. With LONG=1 the other parts have all their tests.
LONG_PARTS := rustdoc miri deny ros2
ALL_PARTS := $(TEST_PARTS) $(LONG_PARTS)
PARTS = $(TEST_PARTS)
# Those that wait for real time.
TIMED := unit e2e python browser pages firmware-test ffi-test test-socketcan
RUNS ?= 5
LOAD ?= 4
SECONDS ?= 60

.PHONY: help demo test verify check flakes $(ALL_PARTS) package wheel mutants fuzz soak bench bench-python reliability sizes table docs header python-table python-docs web-types web monitor deadman view
.PHONY: ros2 fleet-scale fleet-faults install-c pictures semver oldest fmt clean toolchain nightly packages board-target

help: ## this list
	@sed -nE 's/^([a-z0-9-]+):[^#]*## (.*)/\1\t\2/p' Makefile | expand -t 16

demo: toolchain ## 1 min: simulated drives, driven through real ports
	$(CARGO) run --locked -p motorlink-cli --no-default-features -- demo

WHOLE = $(if $(T),$(error T= is for one part: make PART T="..."))\
$(if $(filter-out $(ALL_PARTS),$(PARTS)),$(error there is no part $(filter-out $(ALL_PARTS),$(PARTS))))
monitor: toolchain web ## simulated drives in a browser
	$(CARGO) run --locked -p motorlink-cli --no-default-features --features monitor -- monitor --open

test: toolchain $(if $(SUDO),packages) ## 15 min: parts web-test .. test-socketcan but for unchanged ones; PARTS="unit e2e"; STRICT=1: no skips
	$(WHOLE)
	@$(PYTHON) tests/parts.py $(if $(FORCE)$(LONG),--force) $(if $(STRICT),--strict) $(if $(ONCE)$(STRICT),,--again "$(TIMED)") $(PARTS)

# Before a release, and each night in the public CI. A part that fails has no second chance.
verify: ## 4 h: all parts with all tests, beside a load, on one core, faults, soak, mutants
	$(MAKE) --no-print-directory test PARTS="$(ALL_PARTS)" FORCE=1 ONCE=1 LONG=1
	ROUNDS=50 MODEL=300 $(MAKE) --no-print-directory e2e \
		T="test_owners.py test_monitor.py test_share.py test_share_port.py test_twins.py"
	MODEL=2000 $(MAKE) --no-print-directory unit T="--test share model::"
	$(MAKE) --no-print-directory flakes RUNS=1
	taskset --cpu-list 0 $(MAKE) --no-print-directory flakes RUNS=1 LOAD=0
	$(MAKE) --no-print-directory reliability MOST=1000000
	$(MAKE) --no-print-directory soak
	$(MAKE) --no-print-directory mutants SEED=$$(date +%j) COUNT=20

# Zenoh takes minutes to build.
WITHOUT_NETWORK = --workspace --exclude motorlink-fleet --exclude motorlink-python \
	--no-default-features --features "motorlink-monitor/typescript $(addprefix motorlink-cli/,$(OF_CLI))"
CLI_ALONE = -p motorlink-cli --no-default-features --features "$(OF_CLI)"
OF_CLI := conformance monitor record watch
# The crates with files that differ from this revision.
SINCE ?= HEAD
CHANGED = $(shell { git diff --name-only $(SINCE); git ls-files --others --exclude-standard; } | \
	sed -nE 's,^crates/(motorlink)?([a-z]*)/.*,motorlink-\2,p' | sed 's/-$$//' | sort -u)
check: toolchain ## 1 min: format, clippy, the quick tests of the crates that you changed; not the network of nodes
	$(CARGO) fmt --all --check
	$(CARGO) clippy $(WITHOUT_NETWORK) --all-targets --locked --quiet -- -D warnings
	$(CARGO) test $(addprefix -p ,motorlink-structure $(filter-out motorlink-cli motorlink-fleet,$(CHANGED))) \
		--all-features --locked --quiet --lib --bins --tests -- $(QUICK)
	$(if $(filter motorlink-cli,$(CHANGED)),$(CARGO) test $(CLI_ALONE) --locked --quiet --lib --bins --tests -- $(QUICK))

flakes: PARTS = $(TIMED)
flakes: toolchain $(if $(SUDO),packages) ## 60 min: parts that wait for time, RUNS=5 times beside LOAD=4 hogs
	$(WHOLE)
	@$(PYTHON) tests/parts.py --jobs 1 --runs $(RUNS) --load $(LOAD) $(if $(STRICT),--strict) $(PARTS)

# ---- Parts of make test. T="..." runs some tests of a part. ----

unit: ## 3 min: tests in Rust
	$(CARGO) --config "target.'cfg(unix)'.runner = '$(CURDIR)/tests/measured'" test --workspace --all-features --locked \
		$(or $(T),--lib --bins --tests)
	$(if $(T),,$(CARGO) test --workspace --all-features --locked --doc)

python: package ## 3 min: the Python package: its build, types, examples, tests
	$(VENV)/bin/python -m mypy --strict -p motorlink
	cd bindings/python/tests && $(VENV)/bin/python -m mypy --strict --cache-dir $(CURDIR)/.mypy_cache .
	$(VENV)/bin/python -m mypy.stubtest motorlink._core
	cd bindings/python/tests && $(VENV)/bin/python -m pytest $(PYTEST_FLAGS) $(T)

e2e: package ## 6 min: the program against independent clients
	-@tests/install e2e
	$(PROGRAM)
	cd tests/e2e && MOTORLINK_BIN=$(DEBUG)/motorlink $(PYTEST) $(T)

ros2: $(VENV)/ready ## 8 min: a node and a ROS 2 machine in Rust; not in `make test`
	$(PROGRAM)
	$(CARGO) build --locked --manifest-path tests/ros2/Cargo.toml --target-dir target/ros2
	cd tests/e2e && MOTORLINK_BIN=$(DEBUG)/motorlink ROS2_PEER=$(CURDIR)/target/ros2/debug/ros2-peer \
		$(PYTEST) -p conftest ../ros2 $(T)

web-test: web ## 1 min: the monitor's page: types, tests of its parts, size
	cd web && npm run --silent check && npm test && npm run --silent size

browser: web ## 3 min: the monitor in Debian's Chromium, on simulated drives
	$(if $(AGAIN),,rm -f web/test-results/.last-run.json)
	-@tests/install browser
	$(PROGRAM)
	cd web && MOTORLINK_BIN=$(DEBUG)/motorlink npm run --silent browser -- $(FAILED) $(T)

NIGHTLY_READY := rustup run $(NIGHTLY) cargo miri --version >/dev/null 2>&1 || \
	rustup toolchain install $(NIGHTLY) --profile minimal --component miri --component rust-src
# With few cases a property; brute force is left out. All other crates that it interprets forbid `unsafe`.
miri: ## 2 min: the C face without undefined behaviour; not in `make test`
	@{ $(NIGHTLY_READY); } || \
		{ echo "SKIPPED: miri: $(NIGHTLY) cannot be installed" >&2; exit 0; }; \
	PROPTEST_CASES=2 MIRIFLAGS=-Zmiri-disable-isolation \
		$(CARGO) +$(NIGHTLY) miri test -p motorlink-ffi --locked $(T)

firmware-test: $(VENV)/ready ## 2 min: boards in QEMU against the conformance kit and hosts
	$(PROGRAM)
	CARGO="$(CARGO)" PYTEST="$(PYTEST)" MOTORLINK_BIN=$(DEBUG)/motorlink tests/firmware/run.sh $(T) || [ $$? -eq 77 ]

lint: ## 6 min: format, clippy: no warning; compiles all tests
	$(CARGO) fmt --all --check
	cd fuzz/fuzzers && $(CARGO) fmt --check
	@mkdir -p target; $(CARGO) test --workspace --all-features --locked --no-run >target/$@.log 2>&1; built=$$?; \
		cat target/$@.log; [ $$built = 0 ] && ! grep -q '^warning' target/$@.log
	$(CARGO) clippy -p motorlink-cli --no-default-features --locked -- -D warnings

rustdoc: ## 2 min: rustdoc: no warning
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(WITHOUT_NETWORK) --no-deps --locked

pages: package ## 2 min: every code block of README and docs runs
	cd tests/pages && $(PYTEST) $(T)

# Whether the header is up to date is tested in unit.
ffi-test: ## 1 min: the C face: sanitizers, valgrind, C against the program
	$(PROGRAM)
	CARGO="$(CARGO)" crates/ffi/tests/c/run $(DEBUG)/motorlink || [ $$? -eq 77 ]

test-socketcan: ## 1 min: the port socketcan: in a CAN kernel in QEMU
	$(PROGRAM)
	CARGO="$(CARGO)" MOTORLINK_BIN=$(DEBUG)/motorlink tests/socketcan/run.sh || [ $$? -eq 77 ]

SIZES = $(PYTHON) sizes.py $(or $(CARGO_TARGET_DIR),target)/$(BOARD)/release $(BUILT)/bare-metal/prefix
C_FOR_BOARDS := gcc-arm-none-eabi libnewlib-arm-none-eabi
INSTALL_BARE_METAL = CARGO="$(CARGO)" crates/ffi/packaging/install $(BUILT)/bare-metal/prefix "" $(BOARD) >/dev/null
BARE_METAL := --target $(BOARD) --target-dir $(BUILT)/bare-metal
probe: board-target ## 1 min: the protocols on a Cortex-M4: no panic, flash, RAM
	cd probe && $(CARGO) fmt --check && $(CARGO) clippy --release --locked -- -D warnings
	cd probe && $(CARGO) build --release --locked
	-@tests/install $(C_FOR_BOARDS)
	! command -v arm-none-eabi-ar >/dev/null || $(INSTALL_BARE_METAL)
	cd probe && $(SIZES) --check
	cd firmware && $(CARGO) fmt --check && $(CARGO) clippy --release --locked -- -D warnings
	cd crates/ffi/bare-metal && $(CARGO) fmt --check && $(CARGO) clippy --release --locked $(BARE_METAL) -- -D warnings
	$(CARGO) build -p motorlink-embedded -p motorlink-sim --target $(BOARD) --locked

FINGERPRINT = $(CARGO) run --quiet --locked -p motorlink-kernels
PLAIN := --target-dir target/plain --config profile.dev.package.motorlink-sim.opt-level=0
determinism: ## 1 min: simulated drives, optimised or not, to the last digit
	mkdir -p target
	$(FINGERPRINT) -- fingerprint > target/fingerprint
	$(FINGERPRINT) --profile dist -- fingerprint > target/fingerprint.dist
	$(FINGERPRINT) $(PLAIN) -- fingerprint > target/fingerprint.plain
	cmp target/fingerprint target/fingerprint.dist
	cmp target/fingerprint target/fingerprint.plain

# Other times and other programs do not change the counts.
cost: ## 1 min: instructions of exchanges and simulated drives; UPDATE=1 writes their table
	-@tests/install cost
	$(CARGO) run --profile dist --locked -p motorlink-kernels $(if $(UPDATE),-- --update)

deny: ## 3 min: licences, known holes
	CARGO="$(CARGO)" tests/deny

# ---- Campaigns and figures ----

# AGAIN=1: also those that have a result.
SEED ?= 1
COUNT ?= 120
mutants: $(VENV)/ready ## which single faults in the code no test notices: SEED=1 COUNT=120
	command -v cargo-mutants >/dev/null || $(CARGO) install --locked cargo-mutants
	$(PYTHON) tests/mutants/run.py --seed $(SEED) --count $(COUNT) $(if $(AGAIN),--again)

fuzz: nightly ## every fuzz target for SECONDS=60 each
	command -v cargo-fuzz >/dev/null || $(CARGO) install --locked cargo-fuzz
	NIGHTLY=$(NIGHTLY) fuzz/fuzzers/run $(SECONDS)

# Checks that memory and descriptors do not grow.
soak: ## a million exchanges with a thousand reconnects
	$(CARGO) test --release --locked -p motorlink --all-features --test soak -- --ignored --nocapture

# Fails with a seed and a trace if a guarantee is violated. MOST=1000000 exchanges of each trial, printed.
reliability: ## 100 million exchanges on bad lines, docs/RELIABILITY.md
	$(CARGO) run --release --locked -p motorlink-reliability -- $(if $(MOST),--most $(MOST),--update docs/RELIABILITY.md)

# UPDATE=1 writes them into docs/BENCHMARKS.md, with the engine for SECONDS=60.
bench: $(BENCH_VENV)/ready bench-python ## ratios and instruction counts, as in docs/BENCHMARKS.md
	tests/install valgrind || \
		echo "valgrind cannot be installed: instructions are not counted"
	$(CARGO) build --profile dist --locked -p motorlink-cli
	$(CARGO) run --profile dist --locked -p motorlink-bench -- all \
		$(if $(UPDATE),--seconds $(SECONDS) --update docs/BENCHMARKS.md)

# Installs the Python package and its competitors. If this fails, the benchmark continues without
# them.
bench-python:
	rm -f $(BENCH_VENV)/motorlink
	{ test -x $(BENCH_VENV)/bin/python || $(PYTHON) -m venv $(BENCH_VENV); } && \
		$(BENCH_VENV)/bin/python -m pip install --quiet --config-settings 'build-args=--profile=dist' . pyserial==3.5 && touch $(BENCH_VENV)/motorlink || \
		echo "PYTHON IS NOT MEASURED: the package cannot be installed into $(BENCH_VENV)" >&2

# Installs the other simulators for comparison. If this fails, the benchmark continues without them.
$(BENCH_VENV)/ready: benchmarks/requirements.txt
	rm -f $@
	{ $(PYTHON) -m venv $(BENCH_VENV) && $(BENCH_VENV)/bin/python -m pip install --quiet -r $< && touch $@; } || \
		echo "THE OTHER SIMULATORS ARE NOT MEASURED: they cannot be installed into $(BENCH_VENV)" >&2

sizes: board-target ## flash and RAM on a Cortex-M4, from C and Rust: docs/SIZES.md
	tests/install $(C_FOR_BOARDS)
	$(INSTALL_BARE_METAL)
	cd probe && $(CARGO) build --release --locked && $(SIZES) > ../docs/SIZES.md

# ---- What is written by a command ----

table: ## docs/CHECKS.md: files of tests and what they cost in the last run of `make test FORCE=1`
	$(PYTHON) tests/table.py

docs: ## the tables of docs/CONFORMANCE.md
	MOTORLINK_UPDATE_DOCS=1 $(CARGO) test -p motorlink-conformance --test document --locked

python-table: ## the RMD commands of the Python package: _rmd_table.py
	MOTORLINK_UPDATE_PYTHON=1 $(CARGO) test -p motorlink-python --test table --locked

python-docs: package ## the reference in docs/PYTHON.md
	$(VENV)/bin/python bindings/python/tests/reference.py

web-types: ## the types of messages in the page: web/src/wire.ts
	MOTORLINK_UPDATE_WEB=1 $(CARGO) test -p motorlink-monitor --all-features --locked --test all types::

header: ## crates/ffi/include/motorlink.h
	MOTORLINK_UPDATE_HEADER=1 $(CARGO) test -p motorlink-ffi --test header --locked

# RUNS=50 MOTORLINK_UPDATE_DOCS=1 writes the table of docs/BENCHMARKS.md. CASES=program measures these rows.
deadman: web package ## how long motors turn on after their page or program is gone
	-@tests/install browser
	$(CARGO) build --profile dist --locked -p motorlink-cli
	cd web && RUNS=$(RUNS) MOTORLINK_BIN=$(BUILT)/dist/motorlink npm run --silent measure tests/deadman

# MOTORLINK_UPDATE_DOCS=1 writes the table of docs/BENCHMARKS.md. MINUTES=0: without the soak.
view: web ## how old and how smooth what the page draws is, and its memory
	-@tests/install browser
	$(CARGO) build --profile dist --locked -p motorlink-cli
	cd web && MOTORLINK_BIN=$(BUILT)/dist/motorlink npm run --silent measure tests/view

# SECONDS=60 of each size. MOTORLINK_UPDATE_DOCS=1 writes the table of docs/BENCHMARKS.md.
fleet-scale: $(VENV)/ready ## 10 to 1000 simulated drives in nodes: losses, latency, CPU
	$(CARGO) build --profile dist --locked -p motorlink-cli
	cd benchmarks/fleet && SECONDS=$(SECONDS) $(VENV)/bin/python scale.py

# ROUNDS=30 of each fault. T="router cut" runs some of them. flood takes 10 min.
fleet-faults: $(VENV)/ready ## 30 min: what stops and what is lost when parts of a fleet fail
	$(CARGO) build --profile dist --locked -p motorlink-cli
	cd benchmarks/fleet && $(VENV)/bin/python faults.py $(T)

pictures: web $(VENV)/ready ## draws scenarios (docs/pictures) and screens of the program (docs/*.svg)
	mkdir -p docs/pictures
	$(PROGRAM)
	MOTORLINK_BIN=$(DEBUG)/motorlink $(VENV)/bin/python tests/e2e/pictures.py docs
	cd web && MOTORLINK_BIN=$(DEBUG)/motorlink npm run --silent measure tests/pictures
	@for scenario in scenarios/*.toml; do \
		$(DEBUG)/motorlink sim run $$scenario --plot docs/pictures/$$(basename $$scenario .toml).svg || exit; \
	done

PREFIX ?= /usr/local
# A microcontroller, for example thumbv7em-none-eabihf.
TARGET =
install-c: toolchain ## C header and libraries: PREFIX=/usr/local DESTDIR= TARGET=
	CARGO="$(CARGO)" crates/ffi/packaging/install "$(PREFIX)" "$(DESTDIR)" $(TARGET)

# The Python package as it is tested: with the features of the program, so that it shares that build. Where it
# is up to date it stays: another part may be using it. The same content at the same date is the same wheel.
package: $(VENV)/ready
	@mkdir -p target && flock target/package.lock sh -ec 'export PATH=$(VENV)/bin:$$PATH SOURCE_DATE_EPOCH=1000000000; rm -rf target/package; \
		python -m pip wheel --quiet --no-build-isolation --no-deps --wheel-dir target/package \
			--config-settings "build-args=--profile=dev --features=typescript" .; \
		! cmp -s target/package/*.whl $(VENV)/motorlink.whl || exit 0; \
		rm -f $(VENV)/motorlink.whl; \
		python -m pip install --quiet --force-reinstall --no-deps target/package/*.whl; \
		cp target/package/*.whl $(VENV)/motorlink.whl'
wheel: $(VENV)/ready ## the Python package as a wheel, in target/wheels
	$(VENV)/bin/python -m maturin build --quiet --profile dist --out target/wheels
# Checks the version in rust-version.
oldest: ## compiles the workspace with the oldest Rust that is meant to work
	rust=$$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml) && \
		rustup toolchain install --profile minimal $$rust && \
		$(CARGO) +$$rust check --workspace --all-features --locked --target-dir target/oldest
# Finds incompatible changes that the version number does not allow.
semver: ## the public interface against the last release
	@release=$$(git describe --tags --abbrev=0 --match 'v[0-9]*' 2>/dev/null) || \
		{ echo "there is no release yet (no tag v*) to compare with"; exit 0; }; \
	command -v cargo-semver-checks >/dev/null || $(CARGO) install --locked cargo-semver-checks || exit; \
	$(CARGO) semver-checks --baseline-rev $$release \
		-p motorlink-proto -p motorlink-sim -p motorlink --all-features

fmt: ## formats the Rust code
	for workspace in . fuzz/fuzzers probe firmware crates/ffi/bare-metal; do (cd $$workspace && $(CARGO) fmt --all) || exit; done

clean: ## removes all that was built or installed into this folder
	$(CARGO) clean
	rm -rf $(VENV) $(BENCH_VENV) web/node_modules web/dist probe/target fuzz/fuzzers/target firmware/target

# ---- What they need ----
NPM_FLAGS := --no-audit --no-fund --loglevel=error
# Two parts may want it at once.
web: ## the monitor's page, in web/dist: npm ci and vite
	@mkdir -p target && flock target/web.lock $(MAKE) --no-print-directory web/dist/index.html
web/dist/index.html: web/node_modules/.ready $(shell find web/src web/index.html web/vite.config.ts -type f)
	cd web && npm run --silent build
	@touch crates/monitor/build.rs # which cannot watch a folder that is not there
web/node_modules/.ready: web/package-lock.json
	cd web && npm ci $(NPM_FLAGS) && touch node_modules/.ready
# For systems where rustup does not install the toolchain of rust-toolchain.toml automatically.
toolchain:
	@! command -v rustup >/dev/null || rustup which rustc >/dev/null 2>&1 || rustup toolchain install

nightly:
	@$(NIGHTLY_READY)
# Runs before the parts, because sudo may ask for a password. Each part reports missing packages.
packages:
	$(WHOLE)
	-@$(if $(filter e2e python pages firmware-test,$(PARTS)),$(PYTHON) -m ensurepip --version >/dev/null 2>&1 || \
		tests/install python3-venv)
	-@tests/install $(filter e2e browser ffi-test firmware-test cost test-socketcan,$(PARTS))

board-target: toolchain
	@rustup target list --installed | grep -qx $(BOARD) || rustup target add $(BOARD)

# Two parts may want it at once.
$(VENV)/ready: tests/requirements.txt
	@mkdir -p target && flock target/$(notdir $(@D)).lock $(MAKE) --no-print-directory $(@D).venv FROM=$<
%.venv:
	@test $*/ready -nt $(FROM) || { \
		{ $(PYTHON) -m venv $* || { tests/install python3-venv && $(PYTHON) -m venv $*; }; } && \
		$*/bin/python -m pip install --quiet -r $(FROM) && touch $*/ready; }
