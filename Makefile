# The only entry: everything a fresh clone needs is Rust, Python 3.10+, make and a C compiler.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# What the compiled core and the installed package are made from.
SOURCES := pyproject.toml Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name Cargo.toml)
# Every crate but the binding, which only links inside Python.
CRATES := --workspace --exclude palpate-python
# A test that failed fails again: random cases are the same each time, unless these are set otherwise.
export PROPTEST_RNG_SEED ?= 1
export HYPOTHESIS_PROFILE ?= fixed

.DEFAULT_GOAL := help
.PHONY: help install run view test test-rust test-python bits miri sanitize kills soak soak-mechanics fuzz lint licences deny format bench docs wheel crates models three clean

help: ## Show this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 14

$(BIN)/maturin:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "maturin>=1.16,<2"

$(VENV)/.installed: $(BIN)/maturin $(SOURCES)
	VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --locked --extras all
	@touch $@

# What only those who work on it need.
$(VENV)/.tools: $(VENV)/.installed
	VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --locked --extras all,test,lint
	@touch $@

install: $(VENV)/.installed ## Build the core and install the package into .venv

run: install ## Simulate the paper's case 1: results in out/
	$(BIN)/palpate simulate models/case1.bml --output out $(ARGS)

view: install ## Show the paper's case 2 in the browser
	$(BIN)/palpate view case2 $(ARGS)

test: test-rust test-python ## Run every test: Rust, Python, documents, examples

test-rust:
	cargo test --release --locked --quiet $(CRATES)

test-python: $(VENV)/.tools
	$(BIN)/python -m pytest

bits: ## The same bits in a release and in a debug build
	rm -f target/bits
	PALPATE_BITS=$(abspath target)/bits cargo test --release --locked -p palpate --test bits
	PALPATE_BITS=$(abspath target)/bits cargo test --locked -p palpate --test bits

miri: ## Interpret the SIMD file and look for undefined behaviour (needs a nightly compiler with Miri)
	RUSTFLAGS=-Ctarget-feature=+avx2 cargo +nightly miri test --locked -p palpate-contact --lib simd

sanitize: ## Test detection and the solver with AddressSanitizer (needs a nightly compiler)
	RUSTFLAGS=-Zsanitizer=address cargo +nightly test --release --locked --target x86_64-unknown-linux-gnu \
		-p palpate-contact -p palpate-solver --lib --test detection --test against_dense

kills: $(VENV)/.tools ## Kill every command a hundred times at random
	PALPATE_KILLS=100 $(BIN)/python -m pytest tests/test_interruption.py

soak: ## Compare with the double loop on fresh random scenes for MINUTES (10)
	PALPATE_SOAK=$(or $(MINUTES),10) cargo test --release --locked -p palpate-contact \
		--test soak --test wide -- --nocapture

soak-mechanics: install ## Pull, push and cut the organs of case 2 at random for MINUTES (10), at most STEPS
	$(BIN)/python -m palpate.bench.verification.soak $(or $(MINUTES),10) $(SEED) $(addprefix --steps ,$(STEPS))

FUZZ := language seg vtk blade checkpoint scene simulation

fuzz: ## Throw mutated input at each reader and at the calls for SECONDS (60); SEED= repeats
	cargo build --release --locked -p palpate-fuzz
	@failed=0; for target in $(FUZZ); do \
		$${CARGO_TARGET_DIR:-target}/release/palpate-fuzz $$target $(or $(SECONDS),60) $(SEED) || failed=1; \
	done; exit $$failed

bench: ## Time each stage of detection; count its instructions with valgrind
	cargo bench --locked -p palpate-contact --bench stages
	cargo build --release --locked -p palpate-contact --example stage_count
	$(PYTHON) benchmarks/instructions.py $${CARGO_TARGET_DIR:-target}/release/examples/stage_count

lint: $(VENV)/.tools ## Check format, clippy, rustdoc, ruff and types
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets --release -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --release --no-deps --workspace --exclude palpate-python
	$(BIN)/ruff format --check python tests examples docs
	$(BIN)/ruff check python tests examples docs
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest palpate._core

licences: ## Write the notices of what is linked (needs cargo-about: cargo install cargo-about --features cli)
	cargo about generate --offline --locked --fail -m crates/palpate-python/Cargo.toml about.hbs \
		-o LICENSE-THIRD-PARTY

deny: ## Check licences and advisories of what is linked (needs cargo-deny and the network)
	cargo deny --locked check

format: $(VENV)/.tools ## Format Rust and Python
	cargo fmt --all
	$(BIN)/ruff format python tests examples docs
	$(BIN)/ruff check --fix python tests examples docs

docs: $(VENV)/.docs ## Build the manual: docs/_build/html/index.html
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html
	@echo docs/_build/html/index.html

$(VENV)/.docs: $(VENV)/.tools
	VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --locked --extras all,test,lint,docs
	@touch $@

wheel: $(BIN)/maturin ## Build a wheel for any Python from 3.10 on, and try it in an empty environment
	$(BIN)/maturin build --release --locked --strip --out dist $(ARGS)
	$(PYTHON) tests/try_wheel.py dist

crates: ## Pack the Rust crates as they would be published, and build them from that
	cargo package --locked --workspace --exclude palpate-python --exclude palpate-fuzz --exclude palpate-testing

models: install ## Make the example organs again
	$(BIN)/python python/palpate/models/make_models.py

three: ## Make the viewer's copy of three.js again (needs npm)
	npm install --no-save --prefix target/three three@0.187.0 esbuild@0.28.2
	cp python/palpate/viewer/three.entry.js target/three/
	cd target/three && npx esbuild three.entry.js --bundle --minify --format=esm \
		--legal-comments=inline --outfile=three.module.min.js
	cp target/three/three.module.min.js python/palpate/viewer/page/
	cp target/three/node_modules/three/LICENSE python/palpate/viewer/page/three.LICENSE

clean: ## Remove everything that was built
	rm -rf target $(VENV) out dist docs/_build
