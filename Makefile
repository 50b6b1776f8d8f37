# Doors of the project; `make` alone lists them. Experiments are run by `ddf run`, which has more options.
SHELL := /bin/bash
.DEFAULT_GOAL := help
MAKEFLAGS += --no-print-directory

CONFIG ?= configs/cpu.yaml#   the experiment file
DATA   ?=#                    root that holds ShapeNetCore.v1/ and ShapeNetRendering/ (configs with dataset.source: shapenet)
LAUNCH ?=#                    goes before every training command, such as srun --gres=gpu:1
SEEDS  ?= 1#                  trainings of each model that the tables average; the first is that of SEEDS=1
JOBS   ?= $(shell nproc)#     trainings side by side; each takes train.loop.threads
BENCH  ?=#                    benchmarks by name; without it they are listed
EXTRAS ?=#                    of test-doors, beside the base install; torch brings 6 GB
PYTHON ?=#                    for .venv; without it the first of python3.11, 3.12, 3.13 that is there
UV_VERSION := 0.13.8
READY := .venv/.ready-$(shell pwd | cksum | cut -d' ' -f1)#   another folder is another environment
RUN := .venv/bin/python
export PATH := $(CURDIR)/.venv/bin:$(PATH)
unexport PYTHONDONTWRITEBYTECODE # many containers set it: every process then compiles all that it imports
export PYTHONUNBUFFERED := 1
export CONFIG DATA LAUNCH SEEDS JOBS
override DATA := $(value DATA)#  as it was given, with every $$ in it
run = @ddf run "$$CONFIG" --seeds "$$SEEDS" --jobs "$$JOBS" --data "$$DATA" --launch "$$LAUNCH"

##@ Experiments
reproduce-table: $(READY) ## from nothing to tables, figures and report: CONFIG=configs/cpu.yaml [DATA=/path/to/shapenet] [SEEDS=3]
	$(run)
reproduce-real: CONFIG := configs/real.yaml
reproduce-real: $(READY) ## the same on shapes of other people, fetched by apt-get, beside procedural ones (see `ddf shapes`)
	$(run)
smoke: override CONFIG := smoke
smoke: $(READY) ## synthetic primitives through reconstruction and generative models, in minutes
	$(run) --stage report --stage export_onnx
	@ddf run smoke_generative --jobs "$$JOBS"
GENERATIVE := train_vae normals train_gan train_gan2d train_features evaluate_generative report_generative
reproduce-generative $(GENERATIVE:%=stage-%): CONFIG := configs/generative.yaml
reproduce-generative: $(READY) ## shape VAE, image GANs, their scores and page: [CONFIG=configs/paper_generative.yaml DATA=/path/to/shapenet]
	$(run)
SHAPE_STAGES := stage-fit_shape stage-ablate_samples stage-report_shape
fit-shape $(SHAPE_STAGES): CONFIG := fit
fit-shape: $(READY) ## one field for one shape, what each sample type is worth, and their page: [CONFIG=paper_fit]
	$(run)
figures: CONFIG := configs/figures.yaml
figures: $(READY) ## the figures of the paper, remade, with numbers against exact values
	$(run)
STAGES := $(shell sed -n 's/^\([a-z0-9_]*\):$$/stage-\1/p' pipeline.yaml)
$(STAGES): $(READY) ## one stage (dataset, meshes, ..., report) and what it needs
	$(run) --stage $(@:stage-%=%)
train: $(READY) ## the trainings and what they need, JOBS=4 side by side, each behind LAUNCH="srun --gres=gpu:1"
	$(run) --stage train_ddf --stage train_pcsiren --stage train_ddf_image
report: stage-report ## tables, figures and report of CONFIG (makes what is missing)
publish: $(READY) ## the page of CONFIG as it was made last, to reports/, where git keeps it
	@$(RUN) -m ddf_lab.engine.publish "$$CONFIG"
stale: $(READY) ## the pages and benchmarks in reports/ that other code than today's made; pages say so in their first lines
	@$(RUN) -m ddf_lab.engine.publish

##@ Quality
test: $(READY) ## lint and types, the smoke pipeline, the site and unit tests, two side by side; then the viewer's page and JAX
	@$(MAKE) -j2 --output-sync=target lint smoke site test-unit
	@$(MAKE) -j2 --output-sync=target test-browser test-jax
test-fast: lint test-unit ## lint, types and unit tests
test-unit: $(READY) ## the unit tests, each file by one process
	@$(RUN) -m pytest -q -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder
test-slow: $(READY) ## the tests marked slow: kills, two runs at once, damaged files
	@$(RUN) -m pytest -q -m slow
test-doors: $(READY) ## what pages say to type, in fresh environments of three Pythons, with CPU seconds: [EXTRAS="torch experiments"]
	@$(RUN) -m pytest -q -s -m "" tests/ddf/api/test_install.py -k "base $(EXTRAS:%=or %)"
test-browser: $(READY) ## the page of `ddf view` in Chromium and Firefox (installed by apt-get as root; skipped where there is none)
	@.ci/browsers >/dev/null && $(RUN) -m pytest -q -m browser tests/ddf/io
test-jax: $(READY) ## the tests of `ddf.jax`, with JAX of requirements-jax.lock beside the environment
	@uv pip install -q --python $(RUN) --target .make/jax --no-deps -r requirements-jax.lock
	@PYTHONPATH=.make/jax $(RUN) -m pytest -q tests/ddf/test_jax.py
viewer: ## the page's template of `ddf view` from viewer/src, with npm's packages; needs node
	@cd viewer && npm install --silent && npm run --silent check && npm run --silent build
test-gpu: $(READY) ## the tests marked gpu, on a machine that has one
	@$(RUN) -m pytest -q -m gpu
lint: $(READY) ## format check, lint and types
	@ruff format --check -q . && ruff check -q . && pyright --warnings
bench: $(READY) ## speed against error (reports/bench): BENCH="ray_casting pose"; lists them without
	@$(RUN) -m bench run $(BENCH)

##@ Household
setup: $(READY) ## the environment in .venv, from requirements.lock; nothing to do when it is there
$(READY): requirements.lock pyproject.toml
	@.ci/setup "$(PYTHON)" $(UV_VERSION) $@
site: $(READY) ## the documentation as a site in site/, without live fields; a warning is an error
	@NO_MKDOCS_2_WARNING=1 uv run -q --no-project --isolated --python $(RUN) --with-requirements requirements-docs.lock mkdocs build
docs: site ## the site and the live fields of its gallery
	@$(RUN) docs/gallery.py site/docs/live
clean: ## remove all artefacts (keeps the environment and the committed report)
	rm -rf artifacts .pytest_cache .ruff_cache
help: ## this list
	@awk 'BEGIN {FS = ":.*## "} /^##@/ {printf "\n%s\n", substr($$0, 5)} \
	/^[a-z$$][^:]*:.*## / {name = $$1; if (name ~ /^\$$/) name = "stage-<name>"; printf "  %-21s %s\n", name, $$2}' Makefile
.PHONY: $(shell sed -n 's/^\([a-z][a-z-]*\):.*/\1/p' Makefile) $(STAGES) # all of them
