"""The command `doctor`."""

from __future__ import annotations

import sys

import click

from onespp.render.cli.figures import json_option, show_or_print
from onespp.render.cli.terminal import BAD_INPUT


@click.command()
@json_option
def doctor(json_to: str | None) -> None:
    """Say what will run on this machine, and what to do about what won't."""
    from onespp.render.doctor import examine

    marks = {"ok": "ok   ", "note": "note ", "bad": "BAD  "}
    findings = list(examine())

    def show() -> None:
        for finding in findings:
            click.echo(f"{marks[finding.state]} {finding.subject}: {finding.text}")

    show_or_print(findings, json_to, show)
    if any(finding.state == "bad" for finding in findings):
        sys.exit(BAD_INPUT)
