# make demo   simulated drives, driven through real ports
# make test   everything that is tested, with what it needs installed first
# make docs   writes the tables of docs/CONFORMANCE.md anew
# make soak   a million exchanges with reconnects, some minutes
# make bench  ratios and instruction counts, as in docs/BENCHMARKS.md
# make reliability  both protocols through lines that misbehave, into docs/RELIABILITY.md

CARGO ?= cargo
PYTHON ?= python3
VENV := .venv
TARGET := thumbv7em-none-eabihf
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)
SOCKETCAN := CARGO="$(CARGO)" SUDO="$(SUDO)" tests/socketcan/run.sh

.PHONY: demo test lint unit probe e2e bench docs reliability test-socketcan soak fmt clean

demo:
	$(CARGO) run --release --locked -p motorlink-cli -- demo

# Last, so that what was not tested is said last.
test: lint unit probe e2e
	$(SOCKETCAN) || [ $$? -eq 77 ]

lint:
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets --all-features --locked -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --all-features --no-deps --locked --quiet

unit:
	$(CARGO) test --workspace --all-features --locked

# Both protocols link for a Cortex-M4 without a path that panics, within their RAM.
probe:
	rustup target list --installed | grep -qx $(TARGET) || rustup target add $(TARGET)
	cd probe && $(CARGO) build --release --locked
	$(CARGO) build -p motorlink-proto -p motorlink-sim --target $(TARGET) --locked

# The built program against independent clients on ptys and loopback.
e2e: $(VENV)/ready
	$(CARGO) build -p motorlink-cli --locked
	MOTORLINK_BIN=$$PWD/target/debug/motorlink $(VENV)/bin/python -m pytest -q tests/e2e

# The port socketcan: in Debian's kernel in QEMU. Ends with 77 where the packages cannot be had.
test-socketcan:
	$(SOCKETCAN)

bench:
	command -v valgrind >/dev/null || $(SUDO) apt-get install -y --no-install-recommends valgrind || \
		echo "valgrind cannot be installed: instructions are not counted"
	$(CARGO) run --release --locked -p motorlink-bench -- all

docs:
	MOTORLINK_UPDATE_DOCS=1 $(CARGO) test -p motorlink-conformance --test document --locked

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
	rm -rf $(VENV) probe/target

$(VENV)/ready: tests/e2e/requirements.txt
	$(PYTHON) -m venv $(VENV) || { \
		$(SUDO) apt-get update && $(SUDO) apt-get install -y --no-install-recommends python3-venv && \
		$(PYTHON) -m venv $(VENV); }
	$(VENV)/bin/python -m pip install --quiet -r $<
	touch $@
