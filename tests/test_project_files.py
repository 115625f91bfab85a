"""Files beside the program that a stranger meets: issue form, citation, container."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from onespp.cli import app

yaml = pytest.importorskip("yaml")
ROOT = Path(__file__).parents[1]
PROJECT = (ROOT / "pyproject.toml").read_text()


def in_project(key: str) -> str:
    found = re.search(rf'^{key} = "(.*)"$', PROJECT, re.M)
    assert found
    return found[1]


def test_the_issue_form_asks_for_the_doctor():
    form = yaml.safe_load((ROOT / ".github/ISSUE_TEMPLATE/bug.yml").read_text())
    assert {"name", "description", "body"} <= {*form}
    fields = {field["id"]: field for field in form["body"]}
    assert len(fields) == len(form["body"])
    for field in fields.values():
        assert field["type"] in ("textarea", "input")
        assert field["attributes"]["label"]
    assert "`onespp doctor`" in fields["doctor"]["attributes"]["label"]
    assert fields["doctor"]["validations"]["required"]
    assert "doctor" in app.commands


def test_the_citation_is_of_this_version_and_licence():
    said = yaml.load((ROOT / "CITATION.cff").read_text(), yaml.BaseLoader)  # texts alone
    assert json.dumps(said)
    assert {"cff-version", "message", "title", "authors"} <= {*said}
    assert (said["version"], said["license"]) == (in_project("version"), in_project("license"))
    assert said["authors"] == [{"name": "onespp developers"}]


def test_the_container_runs_the_demo_in_three_lines():
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    assert len(lines) == 3
    assert lines[-1] == 'CMD ["make", "-C", "/onespp", "demo"]'
    assert re.search(r"^demo:", (ROOT / "Makefile").read_text(), re.M)
    python = tuple(map(int, re.findall(r"\d+", lines[0])))
    assert python >= tuple(map(int, re.findall(r"\d+", in_project("requires-python"))))
