# The commands of the README. Everything happens inside .venv; nothing is installed elsewhere.
PYTHON ?= python3.11
BIN := .venv/bin
# Two threads that spin on one busy core are ten times slower than two that wait.
export OMP_WAIT_POLICY ?= PASSIVE
# Where the environment says that Python keeps no bytecode, each of the tests' processes compiles all of it.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: install demo docs test test-fast attack check bench gpu results true-dubs paper-tables speech-table lock
.PHONY: clean verdict-table

# Python compiles the modules that it imports; a compiler of all of them would run for a minute.
PIP := -m pip install -q --disable-pip-version-check --no-compile

# pyproject.toml gives ranges, constraints.txt what was tested.
.venv/installed: constraints.txt pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python $(PIP) -c constraints.txt -e .
	touch $@

.venv/installed-dev: constraints.txt pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python $(PIP) -c constraints.txt -e '.[dev]'
	touch .venv/installed $@

# The library that the networks for faces come from, for the tests that compare both. It asks for an
# older numpy and a second OpenCV, so it has an environment of its own, where these tests look last.
.venv/parity/installed:
	$(PYTHON) -m venv .venv/parity
	.venv/parity/bin/python $(PIP) mediapipe==0.10.21
	touch $@

install: .venv/installed

demo: .venv/installed
	$(BIN)/dfrf demo out/demo

# The tests in WORKERS processes of one thread each: two that share a core wait for one another.
WORKERS ?= 2
test test-fast: PYTEST := OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -n $(WORKERS) --dist worksteal

test: .venv/installed-dev .venv/parity/installed
	$(PYTEST)

# Under a minute on two quiet cores: without the files and tests that are marked slow or medium.
test-fast: .venv/installed-dev
	$(PYTEST) -m "not slow and not medium"

# TIMES as many cases of bad input as `make test` has, from another seed each time; ends with a table.
TIMES ?= 10
SEED ?= $(shell od -An -N4 -tu4 /dev/urandom | tr -d ' ')
attack: .venv/installed-dev
	DFRF_ATTACK=$(TIMES) $(BIN)/python -m pytest -q tests/attack --hypothesis-seed=$(SEED)

# Times a person that was dubbed before, the demo's by default: a frame and a step, part by part. Then what a dubbing
# team waits for, and how it grows, with the clip and speech of WAITS.
BENCH ?= out/demo/demo.yaml alba
WAITS ?= out/demo/source/clip.mp4 out/demo/source/italian.wav
bench: .venv/installed
	$(BIN)/python -m dubbing.workshop.bench.benchmark $(BENCH) out/bench.json
	$(BIN)/python -m dubbing.workshop.bench.dub_times $(WAITS) out/bench-$$(date +%s)
	$(BIN)/python -m dubbing.workshop.bench.growth $(WAITS) out/growth-$$(date +%s)

# Everything that is to be measured on a GPU, into GPU_DAY: 25 minutes; called again it goes on.
GPU_DAY ?= out/gpu
MINUTES ?= 25
gpu: .venv/installed
	$(BIN)/python -m dubbing.workshop.bench.gpu_day $(GPU_DAY) --minutes $(MINUTES)

# Films of the synthetic speaker whose dub has a true picture: makes them, dubs them, compares. SCENES are names or
# patterns; the films take half an hour, once.
TRUE_DUBS ?= out/true-dubs
SCENES ?=
true-dubs: .venv/installed
	$(BIN)/python -m dubbing.workshop.true_dubs.films $(TRUE_DUBS) $(if $(SCENES),--only $(SCENES))
	$(BIN)/dfrf dub $(TRUE_DUBS)/true_dubs.yaml --jobs 2
	$(BIN)/python -m dubbing.workshop.true_dubs.measure $(TRUE_DUBS) $(if $(SCENES),--only $(SCENES))

# The tables of docs/development/results.md: people of manifests, learned with several seeds. Takes hours; goes on
# where it stopped. The real clips lie beside the clone, if at all.
RESULTS ?= ../shared/manifests/p15.yaml ../shared/manifests/real.yaml
SEEDS ?= 0,1,2
METHODS ?= dfrf
EVERY ?= 1
SECONDS ?=
LPIPS ?=
results: .venv/installed
	$(BIN)/python -m dubbing.workshop.lab.results $(RESULTS) --seeds $(SEEDS) --every $(EVERY) \
		$(METHODS:%=--method %) $(SECONDS:%=--seconds %) $(LPIPS:%=--lpips-weights %) \
		--commit "$$(git describe --always --dirty)"

# The tables of docs/development/paper.md: people of the manifest PAPER, learned with several seeds and settings. Takes
# hours; goes on where it stopped, on whatever machine.
paper-tables: .venv/installed
	$(BIN)/python -m dubbing.workshop.lab.paper_tables $(PAPER) --seeds $(SEEDS) $(SECONDS:%=--seconds %) \
		$(LPIPS:%=--lpips-weights %) --commit "$$(git describe --always --dirty)"

check: .venv/installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/test_imports.py

# The schema that ships, and the tables of docs/reference, from the code.
docs: .venv/installed
	$(BIN)/python -m dubbing.workshop.reference

# The tables of docs/development/speech.md: CLIPS of one talking person each, TEST clips never trained on.
speech-table: .venv/installed
	OMP_NUM_THREADS=1 $(BIN)/python -m dubbing.workshop.training.speech.evaluation $(CLIPS) $(if $(TEST),--test $(TEST))

# The tables of docs/development/sync.md: CLIPS of one talking person each, whom the sync network NETWORK never saw.
NETWORK ?= dubbing/sync/weights.safetensors
VERDICT_CACHE ?= out/verdict
verdict-table: .venv/installed
	OMP_NUM_THREADS=1 $(BIN)/python -m dubbing.workshop.training.sync.calibration $(CLIPS) --network $(NETWORK) \
		--cache $(VERDICT_CACHE) $(SECONDS:%=--seconds %)

# Newer versions, within the ranges, of everything with all extras; needs uv.
lock:
	uv pip compile -q pyproject.toml --all-extras --python-version 3.11 --upgrade \
		--no-header --no-annotate --no-emit-index-url -o constraints.txt
	sed -i 's/+cpu$$//' constraints.txt

clean:
	rm -rf .venv out
