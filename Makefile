# make demo            simulated drives, driven through real ports
# make test            everything that is tested, with what it needs installed first
# make test-socketcan  the part of it that needs a CAN kernel, which runs in QEMU
# make firmware-test   the part that runs on an emulated board, in Rust and in C
# make determinism     simulated drives with and without optimisation, to the last digit
# make python          the Python package: built, typed, its examples and its tests
# make wheel           the Python package as a wheel, in target/wheels
# make fuzz            every fuzz target for SECONDS=60 each
# make soak            a million exchanges with reconnects, some minutes
# make bench           ratios and instruction counts, as in docs/BENCHMARKS.md
# make reliability     both protocols through lines that misbehave, into docs/RELIABILITY.md
# make sizes           flash and RAM on a Cortex-M4, into docs/SIZES.md
# make docs            writes the tables of docs/CONFORMANCE.md anew
# make header          writes crates/ffi/include/motorlink.h anew
# make install-c       C header and libraries, pkg-config and CMake files: PREFIX=/usr/local DESTDIR=
# make pictures        plays the scenarios and draws docs/pictures anew
# make semver          the public interface against the last release

CARGO ?= cargo
PYTHON ?= python3
VENV := .venv
PYTHON_VENV := .venv-python
BENCH_VENV := .venv-bench
TARGET := thumbv7em-none-eabihf
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)
SOCKETCAN := CARGO="$(CARGO)" SUDO="$(SUDO)" tests/socketcan/run.sh

FIRMWARE := CARGO="$(CARGO)" SUDO="$(SUDO)" PYTEST="$(VENV)/bin/python -m pytest" tests/firmware/run.sh

SECONDS ?= 60

.PHONY: demo test lint deny unit determinism fuzz-replay miri probe sizes e2e python wheel ffi-test firmware-test
.PHONY: test-socketcan fuzz soak bench reliability docs header install-c pictures semver fmt clean

demo:
	$(CARGO) run --release --locked -p motorlink-cli -- demo

# The last need packages; what was not tested is said last.
test: lint deny unit determinism fuzz-replay miri probe e2e python ffi-test
	$(FIRMWARE) || [ $$? -eq 77 ]
	$(SOCKETCAN) || [ $$? -eq 77 ]

lint:
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets --all-features --locked -- -D warnings
	cd fuzz && $(CARGO) fmt --check && $(CARGO) clippy --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --all-features --no-deps --locked --quiet

unit:
	$(CARGO) test --workspace --all-features --locked

# What fuzzing found, and its seeds, on every target.
fuzz-replay:
	cd fuzz && $(CARGO) test --locked --quiet

# make fuzz SECONDS=600   every fuzz target for so long, one after the other
fuzz:
	rustup run nightly rustc --version >/dev/null 2>&1 || rustup toolchain install nightly --profile minimal
	command -v cargo-fuzz >/dev/null || $(CARGO) install --locked cargo-fuzz
	fuzz/run $(SECONDS)

# Tests of proto and of the C face in an interpreter that sees undefined behaviour, with few cases
# a property.
miri:
	@rustup run nightly cargo miri --version >/dev/null 2>&1 || \
		rustup toolchain install nightly --profile minimal --component miri --component rust-src || \
		{ echo "MIRI DID NOT RUN: there is no nightly toolchain, and it cannot be installed" >&2; exit 0; }; \
	PROPTEST_CASES=2 MIRIFLAGS=-Zmiri-disable-isolation \
		$(CARGO) +nightly miri test -p motorlink-proto -p motorlink-ffi --locked

# Licences, duplicates and sources of every dependency; known holes where their list can be had.
# cortex-m carries two versions of embedded-hal, so the firmware may have duplicates.
deny:
	command -v cargo-deny >/dev/null || $(CARGO) install --locked cargo-deny
	@checks="licenses bans sources"; \
	if $(CARGO) deny fetch db >/dev/null 2>&1; then checks="$$checks advisories"; \
	else echo "ADVISORIES WERE NOT CHECKED: github.com/RustSec/advisory-db cannot be reached" >&2; fi; \
	for manifest in Cargo.toml fuzz/Cargo.toml probe/Cargo.toml; do \
		echo "$$manifest: $$checks"; \
		$(CARGO) deny --manifest-path $$manifest --config deny.toml check $$checks || exit; \
	done; \
	echo "firmware/Cargo.toml: licenses sources"; \
	$(CARGO) deny --manifest-path firmware/Cargo.toml --config deny.toml check licenses sources

# The public interface against the last release: breaks that its version number does not allow.
semver:
	@release=$$(git describe --tags --abbrev=0 --match 'v[0-9]*' 2>/dev/null) || \
		{ echo "there is no release yet (no tag v*) to compare with"; exit 0; }; \
	command -v cargo-semver-checks >/dev/null || $(CARGO) install --locked cargo-semver-checks || exit; \
	$(CARGO) semver-checks --baseline-rev $$release \
		-p motorlink-proto -p motorlink-sim -p motorlink --all-features

# Simulated drives do the same to the last digit with and without optimisation.
FINGERPRINT = $(CARGO) run --quiet --locked -p motorlink-sim --example fingerprint
PLAIN := --target-dir target/plain --config profile.dev.package.motorlink-sim.opt-level=0
determinism:
	mkdir -p target
	$(FINGERPRINT) > target/fingerprint
	$(FINGERPRINT) --release | cmp - target/fingerprint
	$(FINGERPRINT) $(PLAIN) | cmp - target/fingerprint

# Both protocols, and their C face, link for a Cortex-M4 without a path that panics, within their flash
# and RAM. What else is for boards builds there.
SIZES = $(PYTHON) sizes.py $${CARGO_TARGET_DIR:-target}/$(TARGET)/release
probe:
	rustup target list --installed | grep -qx $(TARGET) || rustup target add $(TARGET)
	cd probe && $(CARGO) build --release --locked && $(SIZES) --check
	cd firmware && $(CARGO) fmt --check && $(CARGO) clippy --release --locked -- -D warnings
	$(CARGO) build -p motorlink-embedded -p motorlink-sim --target $(TARGET) --locked

sizes:
	rustup target list --installed | grep -qx $(TARGET) || rustup target add $(TARGET)
	cd probe && $(CARGO) build --release --locked && $(SIZES) > ../docs/SIZES.md

# The built program against independent clients on ptys and loopback.
e2e: $(VENV)/ready
	$(CARGO) build -p motorlink-cli --locked
	MOTORLINK_BIN=$$PWD/target/debug/motorlink $(VENV)/bin/python -m pytest -q tests/e2e

# The C face from a C programmer's side. Says so, and goes on, where compilers cannot be installed.
# (That the header is up to date, a Rust test says.)
ffi-test:
	$(CARGO) build -p motorlink-cli --locked
	CARGO="$(CARGO)" SUDO="$(SUDO)" crates/ffi/tests/c/run $${CARGO_TARGET_DIR:-target}/debug/motorlink || \
		[ $$? -eq 77 ]

# Both boards in QEMU, against the conformance kit and hosts on this machine. Ends with 77 where the
# packages cannot be had.
firmware-test: $(VENV)/ready
	$(FIRMWARE)

# The package as `pip install .` makes it, but for the optimisation; with the checks that its users' code
# would go through.
python: $(PYTHON_VENV)/ready
	$(PYTHON_VENV)/bin/python -m pip install --quiet --config-settings build-args=--profile=dev .
	$(PYTHON_VENV)/bin/python -m mypy --strict -p motorlink
	$(PYTHON_VENV)/bin/python -m mypy.stubtest motorlink._core
	cd bindings/python/tests && ../../../$(PYTHON_VENV)/bin/python -m mypy --strict .
	$(PYTHON_VENV)/bin/python -m pytest -q bindings/python/tests

wheel: $(PYTHON_VENV)/ready
	$(PYTHON_VENV)/bin/python -m maturin build --quiet --release --out target/wheels

# The port socketcan: in Debian's kernel in QEMU. Ends with 77 where the packages cannot be had.
test-socketcan:
	$(SOCKETCAN)

bench: $(BENCH_VENV)/ready bench-python
	command -v valgrind >/dev/null || $(SUDO) apt-get install -y --no-install-recommends valgrind || \
		echo "valgrind cannot be installed: instructions are not counted"
	$(CARGO) run --release --locked -p motorlink-bench -- all

# The package as users have it, and what it is compared with. The benchmark goes on without it, and says so.
bench-python:
	rm -f $(BENCH_VENV)/motorlink
	{ test -x $(BENCH_VENV)/bin/python || $(PYTHON) -m venv $(BENCH_VENV); } && \
		$(BENCH_VENV)/bin/python -m pip install --quiet . pyserial==3.5 && touch $(BENCH_VENV)/motorlink || \
		echo "PYTHON IS NOT MEASURED: the package cannot be installed into $(BENCH_VENV)" >&2

# The other simulators, for comparison. The benchmark goes on without them, and says so.
$(BENCH_VENV)/ready: bench/requirements.txt
	rm -f $@
	{ $(PYTHON) -m venv $(BENCH_VENV) && $(BENCH_VENV)/bin/python -m pip install --quiet -r $< && touch $@; } || \
		echo "THE OTHER SIMULATORS ARE NOT MEASURED: they cannot be installed into $(BENCH_VENV)" >&2

docs:
	MOTORLINK_UPDATE_DOCS=1 $(CARGO) test -p motorlink-conformance --test document --locked

header:
	MOTORLINK_UPDATE_HEADER=1 $(CARGO) test -p motorlink-ffi --test header --locked

PREFIX ?= /usr/local
install-c:
	CARGO="$(CARGO)" crates/ffi/packaging/install $(PREFIX) $(DESTDIR)

pictures:
	mkdir -p docs/pictures
	@for scenario in scenarios/*.toml; do \
		$(CARGO) run --release --locked --quiet -p motorlink-cli -- \
			sim run $$scenario --plot docs/pictures/$$(basename $$scenario .toml).svg || exit; \
	done

# Some 90 million exchanges on virtual time; fails with a seed and a trace where a promise is broken.
reliability:
	$(CARGO) run --release --locked -p motorlink-reliability -- --update docs/RELIABILITY.md

# A million exchanges a protocol with a thousand reconnects: memory and descriptors do not grow.
soak:
	$(CARGO) test --release --locked -p motorlink --all-features --test soak -- --ignored --nocapture

fmt:
	$(CARGO) fmt --all

clean:
	$(CARGO) clean
	rm -rf $(VENV) $(PYTHON_VENV) $(BENCH_VENV) probe/target fuzz/target firmware/target

$(VENV)/ready: tests/e2e/requirements.txt
$(PYTHON_VENV)/ready: bindings/python/tests/requirements.txt
$(VENV)/ready $(PYTHON_VENV)/ready:
	$(PYTHON) -m venv $(@D) || { \
		$(SUDO) apt-get update && $(SUDO) apt-get install -y --no-install-recommends python3-venv && \
		$(PYTHON) -m venv $(@D); }
	$(@D)/bin/python -m pip install --quiet -r $<
	touch $@
