# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# `make help` lists what there is; V=1 shows the commands.

SHELL     := bash
MAKEFLAGS += --no-print-directory
Q         := $(if $(V),,@)
PYTHON    := build/venv/bin/python
PENODE    := build/venv/bin/penode
EXPERIMENT := gen/nqvm/nqvm.toml --scenario sil/scenarios/recalibration.toml
RECORDED  := sil/recordings/friction
RIGS_DIR  ?= ../shared/measured
WORLDS    := 300
MUJOCO    := 240
RIGS      := 28 # two turns of the 14 cases of a draw
WATCHED   := $(PYTHON) test/diagnosis/ablation/probes.py
CASES     := 192 # eight rounds of the 24 cases of a draw
# and of each kind seven in a common form and four in a foreign one, so that one wrong answer is not below 85 or 70 %
LEAST     := single_common=161 single_foreign=88 pair=48 triple=16 null=100 null_hard=100 outside=60
export PENODE_BUILD ?= $(CURDIR)/build/sil
unexport PYTHONDONTWRITEBYTECODE # else every command translates all of its modules anew, for half a second

##@ Every day

help: ## Show this text
	@awk -F ':.*## ' '/^##@ / { printf "\n%s\n", substr($$0, 5) } /^[a-z-]+:.*## / { printf "  make %-23s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(addprefix build/setup/,tools python unity cmock packages) ## Install what is missing; every other target that needs it calls it

run: setup ## The main job: recalibration while it runs, on the host and a Cortex-M4F; then a diagnosis; with pictures
	$(Q)mkdir -p build/run
	$(Q)$(PENODE) simulate $(EXPERIMENT) --on sil -o build/run/sil.csv --plot build/run/recalibration.png
	$(Q)$(PENODE) simulate $(EXPERIMENT) --on pil:m4f -o build/run/pil.csv
	$(Q)cmp build/run/sil.csv build/run/pil.csv
	@echo "host and Cortex-M4F agree to the bit; the picture is build/run/recalibration.png"
	$(Q)$(PENODE) diagnose $(RECORDED)/model.toml --data $(RECORDED)/train.csv --holdout $(RECORDED)/holdout.csv \
	    -o build/run/diagnosis

watch: build/watched/watched.h ## A filter and a fault monitor at 1 kHz on an emulated Cortex-M4F: its status lines (sil/firmware/watch.c)
	$(Q)port/cortex-m/cc mps2-an386 -std=c99 -O2 -Ibuild/watched -o build/watched/watch.elf sil/firmware/watch.c \
	    build/watched/watched{,_params,_ekf,_monitor}.c src/*.c
	$(Q)SHIFT=2 port/cortex-m/run mps2-an386 build/watched/watch.elf

pythons: setup build/setup/pythons ## Packages for other interpreters that are installed here, so that python-install tries the wheel with them too

site: setup build/setup/docs ## The manual as HTML, into build/site; warnings are errors
	$(Q)$(PYTHON) sil/manual/assemble.py build/manual
	$(Q)rm -rf build/site
	$(Q)build/docs/bin/python -m sphinx -q -W --keep-going -b html -d build/docs/doctrees build/manual build/site
	$(Q)cp sil/manual/start.html build/site/index.html
	@echo "build/site/index.html"

test: setup build/setup/docs build/watched/watched.h ## All checks; the last line adds them up
	$(Q)$(PYTHON) test/tally.py -j $$(nproc) --python $(FOLDERS) -- $(GATES)

nightly: setup build/setup/mujoco ## What `make test` takes a sample of: 36 fresh recordings with something hidden, and all tests marked as long
	$(Q)$(PYTHON) test/tally.py -j $$(nproc) hidden-nightly mujoco-nightly python-long $(GATES.misra-long) $(GATES.cores-long)

prove: setup build/setup/proof ## The proofs: all values, all orders, all statements; each also has to find seeded faults
	$(Q)$(PYTHON) test/tally.py $(PROVE_STATIC) $(PROVE_DYNAMIC)

##@ Figures and campaigns

figures: setup ## Measure what our steps cost; rewrite the tables and pictures of README.md and test/bench/ (a picture of the report needs Chromium)
	$(Q)$(PYTHON) test/bench/bench.py --ours
	$(Q)$(PYTHON) test/prove/promises.py

bench: setup ## The same with the steps of other tools (ten minutes, downloads them; test/bench/checkouts.py)
	$(Q)$(PYTHON) test/bench/bench.py
	$(Q)$(PYTHON) test/prove/promises.py

bench-filters: setup ## What an update of the Kalman filter costs beside other forms of it; rewrites test/bench/table.md
	$(Q)$(PYTHON) test/bench/filters.py

campaign: campaign-diagnosis campaign-proofs campaign-fmu ## All three campaigns, hours

campaign-diagnosis: setup build/setup/rivals ## Hide effects in CASES recordings and let the diagnosis and its rivals look for them; RESUME=1 goes on with a draw that was stopped
	$(Q)$(PYTHON) test/diagnosis/campaign.py --cases $(CASES) $(LEAST:%=--least %) $(RESUME:%=--resume) --jobs $$(nproc) --alone 10 --gate \
	    --page test/diagnosis/CAMPAIGN.md --command "$(PENODE) diagnose" \
	    --command "PySINDy=build/rivals/bin/python test/diagnosis/rivals/sindy.py" \
	    --command "neural=build/rivals/bin/python test/diagnosis/rivals/neural.py"

train: setup ## From a recording to a running controller: record, train, check on host and Cortex-M4F, stage in chunks, adopt; with a picture
	$(Q)$(PYTHON) test/training/generator.py build/train
	$(Q)$(PENODE) train test/training/quarter.toml --data build/train/train.csv --holdout build/train/holdout.csv --known m_b -o build/train/trained
	$(Q)cp test/training/adopt.toml build/train/
	$(Q)$(PENODE) simulate build/train/trained/model_trained.toml --scenario build/train/adopt.toml --on sil -o build/train/sil.csv --plot build/train/adopted.png
	$(Q)$(PENODE) simulate build/train/trained/model_trained.toml --scenario build/train/adopt.toml --on pil:m4f -o build/train/pil.csv
	$(Q)cmp build/train/sil.csv build/train/pil.csv
	@echo "host and Cortex-M4F agree to the bit; the picture is build/train/adopted.png, the report build/train/trained/report.html"

onnx-table: setup ## Which operators of ONNX are read, by the cases of its own project; why others are refused
	$(Q)$(PYTHON) test/gen/onnx_table.py

# A part with a row that is not met (-) does not keep the page from being written; the page says so.
campaign-train: setup build/setup/rival_training ## Train on recordings of plants that are known, five seeds each, and on measured dampers: test/training/CAMPAIGN.md; goes on where it was stopped
	$(Q)$(PYTHON) test/training/campaign.py
	$(Q)$(PYTHON) test/training/campaign.py --only tanh --seeds 10
	$(Q)$(PYTHON) test/training/campaign_more.py
	-$(Q)$(PYTHON) test/training/campaign_promises.py
	-$(Q)$(PYTHON) test/training/campaign_rigs.py --rigs $(RIGS_DIR)
	$(Q)$(PYTHON) test/training/campaign_adam.py
	$(Q)$(PYTHON) test/training/campaign_page.py

hidden-mechanisms: setup ## Half-cars with pitch and two-mass drives with something hidden: places, missing forces, nulls; 20 cases of each, minutes
	$(Q)$(PYTHON) test/diagnosis/mechanisms_campaign.py --cases 20

campaign-worlds: setup ## Wrong worlds: plants that are a few per cent wrong everywhere; is the effect named, and nothing else? Half-cars, drives, no tolerances too
	$(Q)$(PYTHON) test/diagnosis/worlds_campaign.py --cases $(WORLDS) --jobs $$(nproc) --out build/worlds/main
	$(Q)$(PYTHON) test/diagnosis/worlds_campaign.py --stratum halfcar --stratum drive --cases 20 --jobs $$(nproc) --out build/worlds/mechanisms
	$(Q)$(PYTHON) test/diagnosis/worlds_campaign.py --stratum main --stratum halfcar --stratum drive --cases 20 --no-tolerance --jobs $$(nproc) --out build/worlds/bare

campaign-mujoco: setup build/setup/mujoco ## Recordings of MuJoCo with something hidden in joints, carts, drives, pendulums, quarter cars: is it named, and nothing else?
	$(Q)$(PYTHON) test/diagnosis/mujoco_cases/mujoco_campaign.py --cases $(MUJOCO) --jobs $$(nproc)

campaign-rigs: setup ## Laboratory rigs with something hidden: RIGS cases of a fresh draw, or of SEED=n; is it named, and nothing else?
	$(Q)$(PYTHON) test/diagnosis/rig_cases/rigs_campaign.py --cases $(RIGS) $(SEED:%=--seed %) --jobs $$(nproc)

campaign-values: setup ## One value or two wrong in model files without tolerances: are these named, and no others?
	$(Q)$(PYTHON) test/diagnosis/values_cases/values_campaign.py --cases 100 --jobs $$(nproc)

ablate: setup ## Which thresholds of the diagnosis decide something, and which go, with every one of them watched: build/ablate/ABLATION.md; hours
	$(Q)rm -rf build/ablate/notes
	$(Q)PROBES=build/ablate/notes $(PYTHON) test/diagnosis/campaign.py --seed 20261126 --cases 300 --jobs $$(nproc) --command "$(WATCHED) diagnose" --out build/ablate/draw
	$(Q)PROBES=build/ablate/notes $(PYTHON) test/diagnosis/worlds_campaign.py --seed 808 --cases 80 --jobs $$(nproc) --command "$(WATCHED) diagnose" --out build/ablate/worlds
	-$(Q)PROBES=build/ablate/notes $(PYTHON) test/diagnosis/rigs_table.py --rigs $(RIGS_DIR) --command "$(WATCHED)" --page build/ablate/RIGS.md
	$(Q)$(PYTHON) test/diagnosis/ablation/ablate.py table build/ablate/notes > build/ablate/ABLATION.md

rigs: setup ## Real rigs in RIGS_DIR: names, hold-out before and after, what a plain expert fit reaches, time; build/rigs/RIGS.md
	$(Q)$(PYTHON) test/diagnosis/rigs_table.py --rigs $(RIGS_DIR) --command $(PENODE) --page build/rigs/RIGS.md

##@ Packages and upkeep

dist: ## Packages for firmware, into build/dist: CMake, pkg-config, PlatformIO, Zephyr, CMSIS-Pack, one .c and one .h; no Python
	$(Q)port/packages/dist.sh build/dist

structure: setup ## Take over counts of long files, long functions, circular imports and thresholds that have fallen
	$(Q)$(PYTHON) test/tools/structure.py --take-over

clean: ## Remove all that was built (the set-up too)
	rm -rf build

.PHONY: help setup run watch pythons test nightly prove figures bench bench-filters train campaign campaign-diagnosis campaign-worlds campaign-mujoco campaign-rigs campaign-values campaign-train onnx-table ablate rigs hidden-mechanisms dist site structure clean

build/setup/tools: test/setup.sh
build/setup/python: requirements.txt pyproject.toml build/setup/tools
build/setup/unity build/setup/cmock build/setup/proof: build/setup/tools
build/setup/pythons: requirements.txt pyproject.toml build/setup/python
build/setup/rivals: test/diagnosis/rivals/requirements.txt build/setup/tools
build/setup/mujoco: test/diagnosis/mujoco_cases/requirements.txt build/setup/python
build/setup/rival_training: test/training/rivals/requirements.txt build/setup/tools
build/setup/packages: test/packages/requirements.txt build/setup/tools
build/setup/docs: sil/manual/requirements.txt build/setup/tools
build/setup/%:
	$(Q)test/setup.sh $*

include test/test.mk
include test/tools/check.mk
include test/prove/prove.mk
