# Each target works from nothing: it makes .venv, installs the messages and the package, then runs.
#   make demo     play a shipped recording through the ROS 2 nodes; leaves out/ with recording, table, report
#   make test     the test suite
#   make check    ruff, mypy, docstrings against signatures
#   make bench    speed and memory, measured
#   make verify   the full counts; writes docs/validation.md
#   make bags     make the shipped recordings again

# The first Python 3.11 or 3.12 that can make virtual environments; or say make PYTHON=...
PYTHON ?= $(shell for p in python3 python3.12 python3.11 python; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info < (3, 13))' 2>/dev/null \
	&& echo $$p && break; done)
RUN := .venv/bin/python
ARGS ?=
# Test processes; each has ROS domains of its own.
WORKERS ?= 2
# Many small matrices: one BLAS thread takes a quarter of the time of several.
export OPENBLAS_NUM_THREADS ?= 1

.NOTPARALLEL:
.PHONY: demo test check bench verify bags run-venv dev-venv clean

demo: run-venv
	$(RUN) -m turnmill_ros.demo $(ARGS)

test: dev-venv
	$(RUN) -m pytest -n $(WORKERS) --dist loadfile $(ARGS)

check: dev-venv
	$(RUN) -m ruff check .
	$(RUN) -m mypy
	$(RUN) tools/check_docstrings.py turnmill_core

bench: dev-venv
	$(RUN) benchmarks/run.py $(ARGS)

verify: dev-venv
	$(RUN) tests/verify.py $(ARGS)

bags: run-venv
	$(RUN) bags/make_bags.py $(ARGS)

run-venv dev-venv:
	@test -n "$(PYTHON)" || { echo "make: Python 3.11 or 3.12 with venv is needed; none was found. Try make PYTHON=/path/to/python3.12" >&2; exit 2; }
	@$(PYTHON) tools/make_venv.py $(if $(filter dev-venv,$@),--dev)

clean:
	rm -rf .venv out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks
