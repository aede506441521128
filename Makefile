# The two commands of a newcomer: `make run` and `make test`.
PYTHON ?= python3
VENV   := .venv
PY     := $(VENV)/bin/python
STAMP  := $(VENV)/.installed

.PHONY: venv run pilot test lint bench docs pictures clean

venv: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev,docs]"
	touch $(STAMP)

run: venv
	$(PY) -m planners.tour --out out

# The whole chain on this machine: plan, pilot, serial line, C firmware, virtual snake, data set, calibration, and
# a plan for the calibrated robot (its gait table is built first, some minutes).
pilot: venv
	mkdir -p out/pilot
	$(PY) -c "from srs_opt.gait_opt.catalogue import default_table; from srs_opt.robot import wpi_srs; \
	from srs_opt.controller.program import Program; from srs_opt.controller.c_source import write_program; \
	from pathlib import Path; \
	write_program(Program.of_table(default_table(wpi_srs(), driver=True), 1e-3), Path('out/pilot/gait_table.h'))"
	$(PY) -m virtual_lab.robot --program out/pilot/gait_table.h --start 0.2,1.024,0 --link out/pilot/valves \
	  --effect tether_drag --duration 90 & \
	sleep 5; $(PY) -m planners.pilot mazes/first.yaml --valves out/pilot/valves --pose udp://127.0.0.1:5005 \
	  --out out/pilot; status=$$?; kill $$!; wait; exit $$status
	$(PY) -m planners.view out/pilot --out out/pilot
	$(PY) -m srs_opt.calibrate out/pilot/dataset --out out/pilot/calibrated
	$(PY) -m planners.plan mazes/first.yaml --robot out/pilot/calibrated/robot.yaml --out out/pilot/again

lint: venv
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

# Commands that tests start find the modules compiled to byte code, whatever the shell says about writing it: the
# import of the planner takes half the time. Types are checked beside the tests' own import.
test: venv
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy & types=$$!; \
	PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 $(PY) -m pytest -n 2 --dist worksteal; tests=$$?; \
	wait $$types && exit $$tests

bench: venv
	$(PY) -m benchmarks

docs: venv
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --strict --site-dir out/site
	@echo "wrote out/site/index.html"

pictures: venv
	$(PY) docs/make_pictures.py
	$(PY) -m docs.make_notebooks

clean:
	rm -rf $(VENV) out build dist *.egg-info
