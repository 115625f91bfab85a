# Everything in two commands: `make demo` and `make test`. Without make: see docs/index.md.
PYTHON ?= python3
BIN := .venv/bin
ifeq ($(OS),Windows_NT)
BIN := .venv/Scripts
endif

.PHONY: demo test pythons lint slow docs results clean

demo: .venv/installed
	$(BIN)/onespp run box --frames 0:8 --size 192x192 --reference-error 0.05 --out data/demo \
	    --method bilateral --method assignment --method atrous --method svgf --method onespp
	@echo "Look at data/demo/pictures."

test: .venv/installed-dev lint
	$(BIN)/python -m pytest -n 2

pythons: .venv/installed-dev
	$(BIN)/python .ci/pythons.py

lint: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/pyright

slow: .venv/installed-dev
	$(BIN)/python -m pytest -m slow

docs: .venv/installed-docs
	$(BIN)/python -m sphinx -E -W --keep-going -q -b html docs build/docs
	@echo "Look at build/docs/index.html."

# All tables of README.md and docs/results.md: an hour on two cores, most of it references; it resumes.
# `make results ARGS=--write` writes the tables, and the pictures with them, into README.md and the docs.
results: .venv/installed-dev
	$(BIN)/python docs/results.py $(ARGS)

.venv/installed: pyproject.toml
	test -d .venv || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

.venv/installed-dev: pyproject.toml
	test -d .venv || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@ .venv/installed

.venv/installed-docs: pyproject.toml
	test -d .venv || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@ .venv/installed

clean:
	rm -rf .venv data build *.egg-info
