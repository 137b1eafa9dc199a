# Start with `make demo` and `make test`. Both do the complete set-up the first time.
#
# PYTHON=/path/to/python3.12 selects another interpreter and recreates .venv.
# `make docs` builds the documentation site into out/docs.
# TEST="-k axis" passes options to pytest, COBOT=--realtime to `make cobot`, HUMANOID=--realtime to
# `make humanoid`, and TELEOPERATION=--realtime to `make teleoperation`, which couples two simulated
# devices over slow networks. HUMANOID=--page serves the operator's page of the humanoid. `make dashboard`
# serves the operator's page of a simulated cobot, or of a target: DASHBOARD=eth0. PORT=8711 selects its
# port. `make rtlab` runs the benchmarks on a real-time kernel in QEMU. TABLE=quick or
# TABLE=pyigh,tasks selects tables, and RTLAB="--out FOLDER" selects the folder of the results.
# `make release` checks a release and writes its files into out/release; RELEASE=--quick only checks.
# TABLE=igh needs IGH=path, the path of a build of IgH's master.
# TABLE=gpio needs GPIO=path, a folder with configfs.ko and gpio-sim.ko for the guest's kernel.
PYTHON ?= python3
VENV := .venv
TEST ?=
COBOT ?=
HUMANOID ?=
TELEOPERATION ?=
DASHBOARD ?=
PORT ?=
TABLE ?= all
RTLAB ?=
IGH ?=
GPIO ?=
RELEASE ?=
SOURCES := CMakeLists.txt pyproject.toml \
           $(shell find src -name '*.pyx' -o -name '*.pxd' -o -name '*.pxi' -o -name '*.h')
CHECKED := src tests tools examples benchmarks docs

ifneq ($(origin PYTHON),file)
  PREFIX := -c 'import sys; print(sys.base_prefix)'
  ifneq ($(shell $(PYTHON) $(PREFIX)),$(shell $(VENV)/bin/python $(PREFIX) 2>/dev/null))
    $(shell rm -rf $(VENV))
  endif
endif

ifeq ($(wildcard $(VENV)/.built)$(filter clean,$(MAKECMDGOALS)),)
  MISSING := $(shell tools/missing_prerequisites $(PYTHON))
  ifneq ($(MISSING),)
    $(error $(MISSING))
  endif
endif

.PHONY: demo cobot humanoid teleoperation dashboard rtlab test lint docs release hooks build clean

demo: $(VENV)/.built
	@$(VENV)/bin/catenary demo

cobot: $(VENV)/.with-cobot
	@$(VENV)/bin/python -m catenary.realtime.private_network examples/cobot/cobot.py $(COBOT)

PAGE := $(findstring --page,$(HUMANOID))
humanoid: $(VENV)/.with-humanoid $(if $(PAGE),$(VENV)/.with-dashboard)
	@$(VENV)/bin/python $(if $(PAGE),,-m catenary.realtime.private_network) examples/humanoid/humanoid.py $(HUMANOID)

teleoperation: $(VENV)/.with-teleoperation
	@$(VENV)/bin/python examples/teleoperation/teleoperation.py $(TELEOPERATION)

dashboard: $(VENV)/.with-dashboard $(VENV)/.with-sim
	@$(VENV)/bin/$(if $(DASHBOARD),catenary dashboard $(DASHBOARD),python examples/cobot/dashboard.py --page)$(if $(PORT), --port $(PORT))

rtlab: $(VENV)/.with-test
	@$(VENV)/bin/python -m tools.rtlab $(TABLE) $(if $(IGH),--igh $(abspath $(IGH))) $(if $(GPIO),--gpio $(abspath $(GPIO))) $(RTLAB)

test: $(VENV)/.with-test
	@$(VENV)/bin/python tools/run_tests.py $(TEST)

lint: $(VENV)/.with-lint
	@$(VENV)/bin/ruff check $(wildcard $(CHECKED))
	@$(VENV)/bin/ruff format --check $(wildcard $(CHECKED))
	@$(VENV)/bin/python tools/words.py src benchmarks tools examples README.md CONTRIBUTING.md docs
	@$(VENV)/bin/mypy
	@$(VENV)/bin/lint-imports --no-logo

docs: $(VENV)/.with-docs
	@missing=$$(tools/missing_prerequisites $(PYTHON) docs); \
	if [ -n "$$missing" ]; then echo "$$missing" >&2; exit 1; fi
	@$(VENV)/bin/python -m sphinx -q -W --keep-going -b html -d out/docs-cache docs out/docs
	@echo "out/docs/index.html"

release: $(VENV)/.with-test $(VENV)/.with-lint $(VENV)/.with-docs
	@$(VENV)/bin/python -m tools.release $(RELEASE)

hooks: $(VENV)/.with-lint
	@$(VENV)/bin/pre-commit install

build: $(VENV)/.with-test

$(VENV)/.built: $(SOURCES)
	@tools/set_up $(VENV) $(PYTHON)

$(VENV)/.with-%: $(VENV)/.built pyproject.toml
	@tools/install_extra $(VENV) $*

clean:
	rm -rf $(VENV) build out
