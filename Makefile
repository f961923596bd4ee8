# Every target sets up what it needs. `make help` lists them.
SHELL := /bin/bash
.DEFAULT_GOAL := demo
.NOTPARALLEL:

# The interpreter to use, 3.10 to 3.13, and the ROS 2 wheels to install where no ROS is sourced:
# jazzy (if left empty) or kilted.
PYTHON ?= python3
DISTRO ?=
DEMO_ARGS ?=
# The vehicle of the demo and of make sim: drone or rocket; and what a drone carries: mavlink, upf or
# both, or with make sim relay.
VEHICLE ?= drone
PARACHUTE ?= mavlink
# The port of the panel of make sim, and what else its command takes.
PORT ?= 8080
SIM_ARGS ?=
# Steps of each story that make explore tries.
DEPTH ?= 2
# Modules of the supervisor that make mutate changes; empty: all.
MODULES ?=
# Parts of make hosts: supervisors, ground, discovery, fleet, packet; empty: all.
PARTS ?=
# Simulator binaries of make sitl, its stories (empty: all; --list in SITL_ARGS names them), and how
# often each is flown.
AUTOPILOT ?=
STORIES ?=
RUNS ?= 3
SITL_ARGS ?=
# Loops of make soak.
LOOPS ?= 300
# How long make fuzz may take.
MINUTES ?= 10
# How many flights of the campaign, and the seed of the first; of so many fly only the first EACH of
# each kind (empty: all). A PyPy of 3.10 or newer, if there is one, flies four times as many a minute;
# SCHEDULER: tcp://HOST:PORT of the Dask cluster to fly on (docs/guide/cluster.md; empty: this machine);
# CAMPAIGN_ARGS: what else the campaign's command takes.
FLIGHTS ?= 1000
SEED ?= 0
EACH ?=
PYPY ?=
SCHEDULER ?=
CAMPAIGN_ARGS ?=
# Where make tapes writes, how many flights of each kind it flies; and the file of tapes that make
# campaign flies (empty: none).
TAPES_FOLDER ?= tapes
TAPES_ARGS ?=
TAPES ?=
# The described vehicles of make minimum-height, and what else its command takes ("--flights 100").
VEHICLES ?= config/vehicles/example_multirotor.yaml config/vehicles/example_aeroplane.yaml
HEIGHT_ARGS ?=
WITHOUT_ARGS ?=
COMPARE_ARGS ?=

SET_UP := command -v "$(PYTHON)" >/dev/null \
    || { echo 'chute_ros set-up: no $(PYTHON) found: install Python 3.10 to 3.13, or name one: make PYTHON=...' >&2; exit 1; }; \
    venv=$$("$(PYTHON)" scripts/set_up.py "$(DISTRO)")
UNDERLAY := $(SET_UP) && . "$$venv/local_setup.sh"
OVERLAY := $(SET_UP) && . "$$venv/env.sh"

# A simulation must not reach other machines, nor a vehicle on them.
LOCAL := export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST

# PyPy uses the environment's packages: of those with compiled parts it takes the parts that are not.
# Told to compile sooner and less at once, and to look for garbage every 32 MB (its own: 4), it
# flies half as many flights again (docs/evidence/speed.md).
FOR_PYPY := export PYPY_GC_NURSERY=32M PYTHONPATH="$$PWD:$$PYTHONPATH:$$(python3 -c \
    'import sys; print(*(p for p in sys.path if p.endswith("-packages")), sep=":")')"
PYPY_JIT := --jit threshold=400,function_threshold=600,trace_eagerness=80,trace_limit=3000

.PHONY: help demo sim test test-long pictures newcomer bench campaign minimum-height compare conformance case without hosts soak sitl build lint docs explore mutate fuzz tapes site lock clean distclean

help: ## say what each target does
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST) | expand -t 18

demo: build ## fly one simulated flight (PARACHUTE=mavlink, upf or both; VEHICLE=rocket)
	@$(OVERLAY) && $(LOCAL) && exec python3 -m chute_ros.tools.demo --vehicle $(VEHICLE) \
	    --parachute $(PARACHUTE) $(DEMO_ARGS)

sim: build ## play with a simulated vehicle until Ctrl-C (VEHICLE=rocket; PARACHUTE=mavlink, upf, both or relay)
	@$(OVERLAY) && $(LOCAL) && exec python3 -m chute_ros.tools.sim --vehicle $(VEHICLE) \
	    --parachute $(PARACHUTE) --port $(PORT) $(SIM_ARGS)

test: build .venv-case/done ## lint, trace the requirements, test both packages, print the totals (DISTRO=kilted for Kilted)
	@$(OVERLAY) && $(LOCAL) && exec scripts/test.sh

test-long: build ## run the tests that are long by nature, write docs/evidence/long_tests.md
	@$(OVERLAY) && $(LOCAL) && scripts/browser.sh && exec python3 scripts/test_long.py

bench: build ## measure against bare scripts, write docs/evidence/bench.md
	@$(OVERLAY) && $(LOCAL) && PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3 -m bench $(BENCH_ARGS)

pictures: build ## fly the tutorial in a browser, keep its pictures in docs/guide/pictures
	@$(OVERLAY) && $(LOCAL) && scripts/browser.sh && CHUTE_PICTURES=docs/guide/pictures exec python3 -m pytest \
	    -q -p no:cacheprovider -m "long or not long" test/panel -k "tutorial or twenty or phone or two_parachutes or not_guarded or rocket_from"

newcomer: build ## from git clone to a parachute released on the page, in a new folder; write docs/evidence/newcomer.md
	@$(OVERLAY) && $(LOCAL) && scripts/browser.sh && PYTHONPATH="$$PWD/test/panel:$$PYTHONPATH" \
	    exec python3 scripts/newcomer.py

campaign: build ## fly FLIGHTS flights in virtual time from SEED on (EACH=n: n of each kind), write docs/evidence/campaign.*
	@$(OVERLAY) && $(if $(PYPY),$(FOR_PYPY) && exec $(PYPY) $(PYPY_JIT),exec python3) \
	    -m chute_ros.tools.campaign --flights $(FLIGHTS) --seed $(SEED) \
	    $(if $(SCHEDULER),--scheduler $(SCHEDULER)) $(CAMPAIGN_ARGS) \
	    $(if $(TAPES),--tapes "$(TAPES)" --tapes-only --page docs/evidence/bodies.md,$(if $(EACH),--each $(EACH) \
	    --page docs/evidence/campaign_of_each.md,--page docs/evidence/campaign.md))

minimum-height: build ## the height and the time that failures of the VEHICLES need, write docs/evidence/minimum_height.*
	@$(OVERLAY) && $(if $(PYPY),$(FOR_PYPY) && exec $(PYPY) $(PYPY_JIT),exec python3) \
	    -m chute_ros.tools.campaign --vehicle $(VEHICLES) --seed $(SEED) \
	    --page docs/evidence/minimum_height.md $(HEIGHT_ARGS)

tapes: .venv-bodies/done ## record multirotors of RotorPy and aeroplanes of JSBSim in TAPES_FOLDER, for make campaign TAPES=...
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 exec .venv-bodies/bin/python -m bodies $(TAPES_FOLDER) $(TAPES_ARGS)

.venv-bodies/done: requirements/bodies.lock
	@rm -rf .venv-bodies && "$(PYTHON)" -m venv .venv-bodies \
	    && .venv-bodies/bin/pip install --quiet --disable-pip-version-check --only-binary :all: \
	        --require-hashes -r requirements/bodies.lock && touch $@

compare: build ## fly FLIGHTS flights from SEED on with this product, ArduPilot's and PX4's checks and a threshold, write docs/evidence/compare.*
	@$(OVERLAY) && $(if $(PYPY),$(FOR_PYPY) && exec $(PYPY) $(PYPY_JIT),exec python3) \
	    -m chute_ros.tools.compare --flights $(FLIGHTS) --seed $(SEED) \
	    --page docs/evidence/compare.md $(COMPARE_ARGS)

conformance: build ## try each conformance kit on devices that break each clause, write docs/evidence/conformance.md
	@$(OVERLAY) && PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3 -m chute_ros.tools.conformance.evidence

without: build ## fly the campaign without a rule or heuristic, to see what needs it (WITHOUT_ARGS="--together ...")
	@$(OVERLAY) && $(if $(PYPY),$(FOR_PYPY) && exec $(PYPY) $(PYPY_JIT),PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3) \
	    scripts/without.py --flights $(FLIGHTS) --seed $(SEED) \
	    $(if $(PYPY),--python "$(PYPY) $(PYPY_JIT)") $(WITHOUT_ARGS)

case: build .venv-case/done ## input to a safety case: pages in case/html, for print in case/pdf, bill of materials
	@$(OVERLAY) && scripts/browser.sh chromium-driver && PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3 -m safety_case

.venv-case/done: requirements/case.lock
	@rm -rf .venv-case && "$(PYTHON)" -m venv .venv-case \
	    && .venv-case/bin/pip install --quiet --disable-pip-version-check --only-binary :all: \
	        --require-hashes -r requirements/case.lock && touch $@

hosts: build ## vehicles, supervisors, ground stations on spoilt networks, write docs/evidence/hosts.md (PARTS=...)
	@$(OVERLAY) && PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3 -m faults $(PARTS)

soak: build ## faults on real processes, LOOPS times from SEED on, write docs/evidence/soak.* (as root)
	@$(OVERLAY) && PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3 -m faults.soak --loops $(LOOPS) \
	    --seed $(SEED) --page docs/evidence/soak.md

sitl: build ## fly real autopilots' simulators (AUTOPILOT="PATH ..."), write docs/evidence/real_autopilots.md
	@$(OVERLAY) && PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3 -m sitl --runs $(RUNS) --page \
	    $(if $(STORIES),--stories $(STORIES) --) $(SITL_ARGS) $(AUTOPILOT)

build: ## build both packages
	@$(UNDERLAY) && exec scripts/build.sh

lint: ## ruff, mypy and the import rule
	@$(UNDERLAY) && exec scripts/lint.sh

docs: build ## write the tables of docs/reference/, config/ and docs/reference/states.* again
	@$(OVERLAY) && export PYTHONPATH="$$PWD:$$PYTHONPATH" \
	    && python3 -m chute_ros.tools.parameter_docs && python3 -m chute_ros.tools.state_diagram

explore: build ## try every story of DEPTH steps on the supervisor's core, write docs/evidence/exploration.md
	@$(OVERLAY) && PYTHONPATH="$$PWD:$$PYTHONPATH" exec python3 -m chute_ros.tools.explore \
	    --depth $(DEPTH)

mutate: .venv-mutate/done ## change the supervisor a little, many times; its tests must notice (MODULES=...)
	@exec .venv-mutate/bin/python scripts/mutate.py $(MODULES)

.venv-mutate/done: requirements/mutate.lock
	@rm -rf .venv-mutate && "$(PYTHON)" -m venv .venv-mutate \
	    && .venv-mutate/bin/pip install --quiet --disable-pip-version-check --require-hashes \
	        -r requirements/mutate.lock && touch $@

fuzz: build .venv-fuzz/done ## feed the decoders what a fuzzer thinks of for MINUTES, write docs/evidence/fuzz.md
	@$(OVERLAY) && $(LOCAL) && PYTHONPATH="$$PWD:$$PWD/.venv-fuzz:$$PYTHONPATH" \
	    exec python3 -m fuzz --minutes="$(MINUTES)"

# Beside the environment of the nodes, whose packages it needs as well.
.venv-fuzz/done: requirements/fuzz.lock
	@$(OVERLAY) && rm -rf .venv-fuzz && { uv pip install --quiet --target .venv-fuzz \
	        --only-binary :all: --require-hashes -r requirements/fuzz.lock \
	    || { echo 'fuzz: atheris has wheels for Linux on x86_64 and Python 3.10 to 3.13 only' >&2; \
	        exit 1; }; } && touch $@

site: .venv-docs/done ## build the site of docs/ into site/; a link that leads nowhere ends it
	@NO_MKDOCS_2_WARNING=1 .venv-docs/bin/mkdocs build --quiet && echo "site/index.html"

.venv-docs/done: requirements/docs.lock
	@rm -rf .venv-docs && "$(PYTHON)" -m venv .venv-docs \
	    && .venv-docs/bin/pip install --quiet --disable-pip-version-check --require-hashes \
	        -r requirements/docs.lock && touch $@

lock: ## refresh requirements/*.lock
	@$(UNDERLAY) && exec scripts/lock.sh

clean: ## remove what was built
	rm -rf build-* install-* log-* build install log site

distclean: clean ## remove the environments as well
	rm -rf .venv-*
