"""The answers to fetch requests, as a client accepts them: an id in them can become the name of a file."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from gateway.calibration.store import ID_PATTERN

Id = Annotated[str, Field(pattern=ID_PATTERN)]
MAX_RECORDS = 1000
"""Basis: a choice; centuries of calibrations, and a bound of a hostile answer."""


class FetchedEntry(BaseModel):
    """One record in the list."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    id: Id
    error: str | None = None
    """Why the gateway cannot read it."""


class FetchedList(BaseModel):
    """The list of records."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    device_id: str
    in_force: Id | None
    review: Id | None
    history: list[dict[str, Any]]
    records: list[FetchedEntry] = Field(max_length=MAX_RECORDS)


class FetchedRecord(BaseModel):
    """One record."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    record: dict[str, Any]


class FetchedAudit(BaseModel):
    """The newest entries of the audit."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    audit: list[dict[str, Any]]
