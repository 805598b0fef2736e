"""Roles, and the caller of a request once it is authenticated."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from gateway.errors import PlumblineError

Scheme = Literal["token", "certificate", "page_pin"]


class Role(StrEnum):
    """What a caller may do. A service engineer may do everything that an operator may."""

    OPERATOR = "operator"
    """Read, acknowledge, mark."""
    SERVICE = "service"
    """Everything: also recalibrate, and change the configuration."""

    def includes(self, other: "Role") -> bool:
        """Return whether this role has the rights of another one."""
        return self is Role.SERVICE or self is other


@dataclass(frozen=True, slots=True)
class Caller:
    """An authenticated caller."""

    name: str | None
    """Common name of the certificate; None for a shared secret, whose holder states a name in the request."""
    role: Role
    scheme: Scheme
    asked_ns: int | None = None
    """Gateway time of the challenge that the caller answered: what came later it cannot have meant. None: there was none."""


class NotAuthorised(PlumblineError):  # noqa: N818  (not an error: the answer is no, and the text states why)
    """A request is refused before it is considered; the text states the reason and the remedy."""

    def __init__(self, kind: str, text: str, name: str | None = None) -> None:
        """`kind` groups refusals in counters; `name` is the authenticated or stated name, where there is one."""
        super().__init__(text)
        self.kind = kind
        self.name = name


def require_role(caller: Caller, role: Role) -> None:
    """Raise `NotAuthorised` where a caller has not the rights of a role."""
    if not caller.role.includes(role):
        raise NotAuthorised(
            "wrong_role", f"the role {caller.role} may not do this; it needs the role {role}", caller.name
        )
