# Everything from a fresh clone: only python3 and make are needed.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready

.PHONY: venv demo test suite long lint browser bench campaign fuzz kills endurance blind moved thresholds mutants journey locked sbom release-check docs clean

venv: $(READY)

$(READY): pyproject.toml positioner/__init__.py
	$(PYTHON) -m venv --upgrade-deps $(VENV)
	@# Modules are compiled when they are first imported: most of what comes with the packages never is.
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable '.[dev]'
	touch $(READY)

demo: $(READY)          ## a sticking valve identified and controlled over Modbus, in under a minute
	$(BIN)/positioner demo --out demo-out

test: $(READY)          ## lint, types, import contracts and the whole test suite, at the same time
	$(MAKE) --no-print-directory --jobs=2 suite lint

suite: $(READY)
	@$(MAKE) --no-print-directory browser # no prerequisite: that one ends at once, and make -j may begin the next only after lint
	@# What pytest makes of the tests' files is kept: in a fresh clone once, not in every worker.
	@test -e $(VENV)/.rewritten || { $(BIN)/pytest --collect-only -qq > /dev/null; touch $(VENV)/.rewritten; }
	$(BIN)/pytest --numprocesses=auto -m 'not long'

long: $(READY) browser  ## the tests that take long: whole searches, journeys and campaigns, every recipe followed
	$(BIN)/pytest --numprocesses=auto -m long

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m docs.words

browser:                ## Debian's Chromium, for the tests of the pages; where nobody may install it, they are skipped
	@command -v chromium >/dev/null || [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null || \
	    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends chromium; } \
	    >/dev/null || echo "no chromium to be had: the tests of the pages are skipped"

bench: $(READY)         ## figures that depend on the machine, as ratios in one run
	$(BIN)/python -m benchmarks

campaign: $(READY)      ## every fault in every state on each bus: some twenty minutes, prints the table
	$(BIN)/python -m benchmarks.campaign

fuzz: $(READY)          ## every parser on ten million inputs, guided by coverage: some hours, prints the table
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[fuzz]'
	$(BIN)/python -m benchmarks.fuzz --inputs 10000000

kills: $(READY)         ## kill -9 at random instants, 300 times: some twenty minutes, prints the table
	$(BIN)/python -m benchmarks.kills --times 300

endurance: $(READY)     ## an hour at 1 kHz and a month in virtual time: does anything grow, drift or stop?
	$(BIN)/python -m benchmarks.endurance --minutes 60 --days 30

blind: $(READY)         ## hours, can be broken off: what is missing of the blind campaign, and its tables
	$(BIN)/python -m benchmarks.blind

moved: $(READY)         ## hours, can be broken off: what law and workbench do and say of the kept cases otherwise than before
	$(BIN)/python -m benchmarks.kept_law
	$(BIN)/python -m benchmarks.blind --moved build/moved.jsonl

thresholds: $(READY)    ## hours for all, a sample by default: what a diagnosis says when a threshold is changed by 30 %
	$(BIN)/python -m benchmarks.thresholds

mutants: $(READY)       ## hours for all, a sample by default: changes of constants and branches that no test sees
	$(BIN)/python -m benchmarks.mutants

journey: $(READY) browser ## minutes: a dropped recording with a hidden effect, the whole library, to the error at the floor, in a browser
	$(BIN)/python -m benchmarks.workbench_journey

locked: $(READY)        ## the packages of a gateway, pinned with their hashes: after a change of pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[supply]'
	$(BIN)/pip-compile --quiet --generate-hashes --strip-extras --no-header --no-annotate --no-emit-index-url \
	    --no-emit-trusted-host --no-emit-find-links --build-deps-for wheel --extra tls --extra canopen --extra metrics --extra opcua \
	    --output-file deploy/locked/gateway.txt pyproject.toml

sbom: $(READY)          ## what a gateway installs, as CycloneDX: dist/positioner.cdx.json
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[supply]'
	$(PYTHON) -m venv --clear build/gateway
	build/gateway/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r deploy/locked/gateway.txt
	build/gateway/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation .
	mkdir -p dist
	$(BIN)/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible --of JSON -o dist/positioner.cdx.json \
	    build/gateway/bin/python

release-check: $(READY) ## minutes: sdist and wheel, tried outside the tree on each Python that is found
	$(BIN)/python .ci/release_check.py

docs: $(READY)          ## the documents' pictures and figures, made anew
	$(BIN)/python -m benchmarks.paper --out docs/img
	$(BIN)/positioner demo --out demo-out && cp demo-out/run.png docs/img/demo.png
	$(BIN)/python -m benchmarks.flow --out docs/img
	$(BIN)/python -m docs.operator_picture docs/img/operator-page.png
	$(BIN)/python -m docs.page_pictures docs/img
	$(BIN)/python -m docs.drawings docs/img
	$(BIN)/python -m docs.code_tables
	$(BIN)/python -m sim.effects docs/effects.md
	$(BIN)/python docs/notebook.py docs/tutorial.md docs/recordings.md docs/valve-file.md

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache demo-out build dist
