"""What installed packages offer: methods, metrics and scenes, by `importlib.metadata`.

In a package's pyproject.toml:

    [project.entry-points."onespp.methods"]
    my-filter = "my_package.filters:MyFilter"

Looked up only for names that nothing of onespp's has, and in lists.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from .user_code import UserCode

METHODS, METRICS, SCENES = "onespp.methods", "onespp.metrics", "onespp.scenes"


@dataclass(frozen=True)
class Offer:
    """One name that a package offers.

    Attributes:
        package, version: of the distribution; "" where nobody says.
    """

    name: str
    package: str
    version: str
    point: EntryPoint

    def load(self, what: str, error: type[Exception]) -> tuple[Any, InstalledCode]:
        """The object, and the code that it is of.

        Args:
            what: it is, as "method", for messages.

        Raises:
            error: it cannot be imported.
        """
        code = InstalledCode(f"the {what} '{self.name}' of the package {self.package}",
                             self.point.module.partition(".")[0], error)
        with code.running():
            return self.point.load(), code


class InstalledCode(UserCode):
    """Code of an installed package; lines of all of its modules are its own."""

    def __init__(self, shown: str, package: str, error: type[Exception]) -> None:
        super().__init__(shown, error)
        self.package = package

    def _owns(self, file: str, module: str) -> bool:
        return module.partition(".")[0] == self.package

    def _where(self, file: str, line: int | None) -> str:
        return f", {file}, line {line}" if line else ""


def offers(group: str) -> list[Offer]:
    """All of a group, by name; two of one name where two packages have it."""
    found = {(p.name, p.dist.name if p.dist else "", p.value): p
             for p in entry_points(group=group)}
    return [Offer(name, package, point.dist.version if point.dist else "", point)
            for (name, package, _), point in sorted(found.items())]


def offered(name: str, group: str, error: type[Exception]) -> Offer | None:
    """The one of that name; None if no package has it.

    Raises:
        error: several packages have it.
    """
    found = [offer for offer in offers(group) if offer.name == name]
    if len(found) > 1:
        raise error(f"'{name}' is offered by several packages, "
                    f"{' and '.join(offer.package for offer in found)}: remove all but one")
    return found[0] if found else None
