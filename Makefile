# Everything runs in .venv, which any target that needs it makes first: Python 3.11 or later and make are enough.
#   make PYTHON=/path/to/python3.12 ...   choose the Python        make JOBS=8 test   test processes (6)

BIN := .venv/bin

export PYTHON
unexport PYTHONHOME PYTHONPATH PYTHONDONTWRITEBYTECODE
MAKEFLAGS += --no-print-directory

# most tests of flights wait: four processes fly while two compute
test slow: JOBS ?= 6
soak mutate wrong: JOBS ?= 4

.DEFAULT_GOAL := help
.PHONY: help setup demo test slow clients lint soak fuzz mutate wrong bench size dist trustzone-m optee clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-6s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

setup: ## make .venv and the boundary in C, or bring them up to date
	@.make/setup
	@.make/boundary

demo: setup ## refuse four proposals, fly one on the simulated vehicle, verify its log and draw it as a page
	@$(BIN)/rtshcua demo --folder build/demo

test: setup ## run the tests; decision, wire and evidence covered in full
	$(BIN)/pytest -n $(JOBS) --cov --cov-report term

slow: setup ## run the tests that take half a second and more each: flights, processes, searches, samples of benchmarks
	$(BIN)/pytest -n $(JOBS) -m "slow and not soak and not clients"

clients: setup ## run the tests with programs that others made, and of the wheel; as root, install what is missing
	@.make/clients

lint: setup ## check style, format, types and layers, of our sources too
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	MYPYPATH=tests $(BIN)/mypy bench
	$(BIN)/lint-imports
	$(BIN)/rtshcua fmt --check skills policies missions evaluation examples
	$(BIN)/rtshcua lint skills policies missions evaluation examples

soak: setup ## run the long campaigns, and every property test with many examples; flights go on where they stopped
	@.make/optee || echo "soak: the tests by OP-TEE are skipped"
	$(BIN)/pytest -n $(JOBS) --most 0 -m "soak or hypothesis" --hypothesis-profile soak
	RTSHCUA_BOUNDARY=build/boundary/librtshcua.so $(BIN)/pytest -p reference.shadow
	@if command -v frama-c >/dev/null; then make -C boundary proof; else echo "soak: no frama-c, so nothing was proved"; fi
	$(BIN)/rtshcua campaign missions/short.rts --at 2026-06-01T08:00:00Z --flights $(or $(FLIGHTS),100000) -o build/soak-campaign

fuzz: setup ## look for inputs that break parser, checker, compiler or boundary: MINUTES=10, TARGETS=... for some
	@MINUTES="$(MINUTES)" .make/fuzz $(TARGETS)

mutate: setup ## change one thing at a time in what decides, and list what no test notices (docs/mutation.md)
	@.make/mutate "$(or $(TARGETS),rtshcua/decision)" "$(or $(TESTS),tests/unit/decision)" $(JOBS) "$(or $(MUTANTS),*_1)"

wrong: setup ## fly campaigns against wrong runtimes, and count the flights that find them (docs/flying/wrong-runtimes.md)
	@$(BIN)/python .make/wrong $(TARGETS) --flights $(or $(FLIGHTS),120) --seeds $(or $(SEEDS),1) --jobs $(JOBS)

bench: setup ## run every benchmark, or TARGETS; each against a peer or a limit, with a table of held and missed at the end
	@$(BIN)/python .make/bench $(TARGETS)

size: setup ## count modules, code lines, shared names and long functions by package; the footprint of each home of the boundary
	@$(BIN)/python .make/size
	@$(BIN)/python .make/footprint

trustzone-m: setup ## fly a mission by the boundary in the secure world of a Cortex-M33, emulated; as root, install what is missing
	@.make/trustzone-m fly

optee: setup ## fly a mission by the boundary in a trusted application of OP-TEE, emulated; as root, install what is missing
	@.make/optee fly

dist: setup ## build the wheels into dist, and their bill of materials (CycloneDX); the same bytes each time
	@.make/dist $(BIN)/python

clean: ## remove set-up, builds and caches; runs/ and keys stay
	rm -rf .venv build dist .coverage .coverage.* .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find rtshcua tests bench -name __pycache__ -type d -prune -exec rm -rf {} +
