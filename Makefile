# Every door of the project; `make` alone lists them.
SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c
.DEFAULT_GOAL := help
MAKEFLAGS += --no-print-directory

# ---- what you may set: make reproduce-table CONFIG=configs/paper.yaml DATA=/path/to/shapenet LAUNCH="srun --gres=gpu:1"
CONFIG ?= configs/cpu.yaml#   the experiment file
DATA   ?=#                    root that holds ShapeNetCore.v1/ and ShapeNetRendering/ (configs with dataset.source: shapenet)
LAUNCH ?=#                    goes before every training command
SEEDS  ?= 1#                  trainings of each model that the tables average; the first is that of SEEDS=1
BENCH  ?=#                    some of the benchmarks, by name; all without it
OPTIONS ?=#                   of `make fit-proof` and of `make ablate-options`
JOBS   ?= $(shell nproc)#     trainings side by side; each takes train.loop.threads
PYTHON ?= $(shell command -v python3.11 || command -v python3)

CONFIG := $(strip $(CONFIG))
NAME := $(basename $(notdir $(CONFIG)))
UV_VERSION := 0.13.8
VENV := .venv
READY := $(VENV)/.ready-$(shell pwd | cksum | cut -d' ' -f1)#   another folder is another environment
RUN := $(VENV)/bin/python
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export PYTHONUNBUFFERED := 1
unexport PYTHONDONTWRITEBYTECODE # many containers set it: every process then compiles all that it imports, up to 8 s a stage
export LAUNCH := $(strip $(LAUNCH))
export PET_NO_PYTHON := 1#    torchrun in LAUNCH starts the command behind it, which is not a script
export SEEDS := $(strip $(SEEDS))
ifneq ($(strip $(DATA)),)
export DDF_DATA := $(abspath $(strip $(DATA)))
endif

# One run at a time. The lock is the kernel's: it is gone when the last process of a run is, however that ended; what
# DVC itself left behind (rwlock) is then stale. DATA and SEEDS are kept per experiment in files, which the engine can
# watch; params.yaml tells it of the stages of further seeds.
define locked
@[[ $$SEEDS =~ ^[1-9][0-9]*$$ ]] || { echo "SEEDS=$$SEEDS: must be a whole number, 1 or more" >&2; exit 2; }; \
mkdir -p .make .dvc/tmp artifacts/$(NAME)/evaluate_seeds || exit 2; exec 9>>.make/lock || exit 2; \
flock -n 9 || { echo "another run holds this folder (process $$(cat .make/lock.pid 2>/dev/null)); waiting for it to end" >&2; flock 9; }; \
echo $$$$ > .make/lock.pid; rm -f .dvc/tmp/rwlock; \
root=artifacts/$(NAME)/data_root; \
if [ -n "$$DDF_DATA" ] || [ ! -e $$root ]; then cmp -s $$root <<< "$$DDF_DATA" || echo "$$DDF_DATA" > $$root || exit 2; fi; \
export DDF_DATA="$$(cat $$root)"; \
seeds=artifacts/$(NAME)/evaluate_seeds/count; cmp -s $$seeds <<< $$SEEDS || echo $$SEEDS > $$seeds || exit 2; \
python -m ddf.seed_items $(NAME) $$SEEDS || exit 2; \
$(1)
endef
# Stages of one experiment by the name's pattern, side by side: DVC itself runs one at a time, so make does it, and knows
# what waits for what. DVC's own lock is held while it looks at files, for longer than the three seconds that it would
# wait without being told to. Seed 0 goes first; where one fails, the others go on. Of data two stages at a time, each
# with a process per core: one starts or ends while the other works. Clouds use the cores that trainings leave.
names = dvc stage list --name-only | grep -E '^$(1)@$(NAME)(-|$$)'
side_by_side = jobs=$$($(names) | sort -s -t- -k3n | sed 's/^/alone-/') && $(MAKE) -k -j $(2) $$jobs
alone = dvc --wait-for-lock repro --single-item "$(@:alone-%=%)"
alone-meshes@%:
	@$(alone)
alone-samples@%: alone-meshes@%
	@$(alone)
alone-train_%:
	@$(alone)
alone-pointclouds@%: alone-train_ddf@% alone-train_pcsiren@%
	@nice -n 5 $(alone)
one_by_one = names=$$($(names)) && dvc repro $$names
whole_run = dvc status -q --with-deps report@$(NAME) || { $(call one_by_one,dataset) \
	&& $(call side_by_side,(meshes|samples),2) && $(call side_by_side,(train_[a-z]*|pointclouds),$(JOBS)) \
	&& dvc repro report@$(NAME); }
check_config = @test -f "$(CONFIG)" || { echo "$(CONFIG): no such experiment file; CONFIG is one of: $$(echo configs/*.yaml)" >&2; exit 2; }; \
	grep -q "^ *$(NAME):" pipeline.yaml || { echo "$(CONFIG): pipeline.yaml has no experiment '$(NAME)'; add it to the lists under vars" >&2; exit 2; }

##@ Experiments
.PHONY: reproduce-table
reproduce-table: $(READY) ## from nothing to tables, figures and report: CONFIG=configs/cpu.yaml [DATA=/path/to/shapenet] [SEEDS=3]
	$(check_config)
	$(call locked,$(whole_run)) && echo "reports/$(NAME)/README.md"

.PHONY: smoke
smoke: NAME := smoke
smoke: $(READY) ## synthetic primitives through every stage, in minutes
	$(call locked,$(whole_run) && $(call one_by_one,export_onnx)) && echo "reports/smoke/README.md"

# One field for one shape: another kind of experiment file, with the section `fit` alone.
SHAPE_STAGES := fit_shape ablate_samples report_shape
SHAPE_TARGETS := fit-shape $(addprefix stage-,$(SHAPE_STAGES))
$(SHAPE_TARGETS): CONFIG := configs/fit.yaml
$(SHAPE_TARGETS): NAME = $(basename $(notdir $(CONFIG)))
check_shape_config = @grep -qs "^fit:" "$(CONFIG)" || { echo "$(CONFIG): no such file with a section fit; CONFIG is one of: $$(echo $$(grep -l '^fit:' configs/*.yaml))" >&2; exit 2; }; \
	grep -q "^ *shapes: \[[^]]*\b$(NAME)\b" pipeline.yaml || { echo "$(CONFIG): pipeline.yaml has no shape '$(NAME)'; add it to the list shapes" >&2; exit 2; }
# The mesh is named by the config alone; its checksum is kept in a file, which the engine can watch.
record_mesh = mesh=$$(sed -n 's/^  mesh: *\([^ ]*\).*/\1/p' "$(CONFIG)"); made=artifacts/$(NAME)/mesh.sha256; \
	sum=$$(cat "$$mesh" 2>/dev/null | sha256sum); cmp -s $$made <<< "$$sum" || echo "$$sum" > $$made

.PHONY: fit-shape
fit-shape: $(READY) ## one field for one shape, what each sample type is worth, and their page: [CONFIG=configs/paper_fit.yaml]
	$(check_shape_config)
	$(call locked,$(record_mesh) && $(call one_by_one,report_shape)) && echo "reports/$(NAME)/README.md"

.PHONY: $(addprefix stage-,$(SHAPE_STAGES))
$(addprefix stage-,$(SHAPE_STAGES)): stage-%: $(READY)
	$(check_shape_config)
	$(call locked,$(record_mesh) && $(call one_by_one,$*))

STAGES := dataset meshes samples train_ddf train_pcsiren export_onnx pointclouds evaluate report
.PHONY: $(addprefix stage-,$(STAGES))
$(addprefix stage-,$(STAGES)): stage-%: $(READY) ## one stage (dataset, meshes, ..., report) and what it needs
	$(check_config)
	$(call locked,$(call one_by_one,$*))

.PHONY: train
train: $(READY) ## the trainings alone, JOBS=4 side by side, each behind LAUNCH="srun --gres=gpu:1"
	$(check_config)
	$(call locked,$(call side_by_side,train_[a-z]*,$(JOBS)))

.PHONY: report
report: stage-report ## tables, figures and report of CONFIG (makes what is missing)

.PHONY: dag
dag: $(READY) ## the stages of CONFIG as a graph
	$(check_config)
	@dvc dag report@$(NAME)

##@ Quality
.PHONY: test
test: test-fast smoke ## set-up, lint, types, unit tests, then the smoke pipeline

.PHONY: test-fast
test-fast: lint ## lint, types and unit tests
	@$(RUN) -m pytest -q

.PHONY: test-slow
test-slow: $(READY) ## the tests marked slow: kills, two runs at once, damaged files
	@$(RUN) -m pytest -q -m slow

.PHONY: test-gpu
test-gpu: $(READY) ## the tests marked gpu, on a machine that has one
	@$(RUN) -m pytest -q -m gpu

.PHONY: lint
lint: $(READY) ## format check, lint and types
	@ruff format --check -q . && ruff check -q . && pyright --warnings

.PHONY: bench
bench: $(READY) ## speed against error (reports/bench) and the page of hard cases: [BENCH="evaluation rendering"]
	@$(RUN) -m bench run $(BENCH)

.PHONY: bench-check
bench-check: $(READY) ## the benchmarks once more, compared with reports/bench: [BENCH="evaluation rendering"]
	@$(RUN) -m bench check $(BENCH)

.PHONY: fit-proof
fit-proof: $(READY) ## what fits of single shapes reach, in hours: [PROOFS="fit_curves primitive_fits"] [OPTIONS="--side-by-side 2"]
	@$(RUN) -m bench run $(or $(PROOFS),fits) -- $(OPTIONS)

.PHONY: ablate-options
ablate-options: $(READY) ## every switch of the reconstruction turned alone, up to an hour: [OPTIONS="--steps 800"]
	@$(RUN) -m bench run si3dr_options -- $(OPTIONS)

##@ Household
.PHONY: setup
setup: $(READY) ## the environment in .venv, from requirements.lock; nothing to do when it is there

$(READY): requirements.lock pyproject.toml
	@.ci/setup "$(PYTHON)" $(UV_VERSION) $@

.PHONY: docs
docs: $(READY) ## the documentation as a site in site/; a warning is an error
	@NO_MKDOCS_2_WARNING=1 uv run -q --no-project --isolated --python $(RUN) --with-requirements requirements-docs.lock mkdocs build

.PHONY: clean
clean: ## remove all artefacts (keeps the environment and the committed report)
	rm -rf artifacts params.yaml .dvc/cache .dvc/tmp .pytest_cache .ruff_cache

.PHONY: help
help: ## this list
	@awk 'BEGIN {FS = ":.*## "} /^##@/ {printf "\n%s\n", substr($$0, 5)} \
	/^[a-z$$][^:]*:.*## / {name = $$1; if (name ~ /^\$$/) name = "stage-<name>"; printf "  %-18s %s\n", name, $$2}' Makefile
