"""The command `doctor`."""

from __future__ import annotations

import sys

import click

from onespp.render.cli.terminal import BAD_INPUT


@click.command()
def doctor() -> None:
    """Say what will run on this machine, and what to do about what won't."""
    from onespp.render.doctor import examine

    marks = {"ok": "ok   ", "note": "note ", "bad": "BAD  "}
    findings = list(examine())
    for finding in findings:
        click.echo(f"{marks[finding.state]} {finding.subject}: {finding.text}")
    if any(finding.state == "bad" for finding in findings):
        sys.exit(BAD_INPUT)
