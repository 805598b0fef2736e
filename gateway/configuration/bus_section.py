"""The section of the bus: endpoints, TLS certificates with the check of their files, and what others may do on it."""

import re
from collections.abc import Iterator, Mapping
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from gateway.configuration.section import NAME, Section
from gateway.extras import what_is_missing
from gateway.topics import KEY_PREFIX

ENCRYPTED_PROTOCOLS = ("tls", "quic")
NETWORK_PROTOCOLS = ("tcp", "udp", "ws", *ENCRYPTED_PROTOCOLS)
LOCAL_PROTOCOLS = ("unixsock-stream", "unixpipe")
PARAMETERS = "?#;"
"""Characters from which on Zenoh reads parameters of a link out of its endpoint, such as `enable_mtls=false`."""
CommonName = Annotated[str, Field(min_length=1, max_length=64)]
SubtreeKey = Annotated[str, Field(pattern=f"^{KEY_PREFIX.removesuffix('/')}(/{NAME}){{1,3}}$")]
EXPIRES_SOON_DAYS = 30
"""A certificate with fewer days left is reported. Basis: a choice; time for the next visit at a crane, and no warning for
years."""


def check_endpoint(endpoint: str) -> str:
    """Return an endpoint that names protocol and address alone. Raises `ValueError` for any other."""
    protocol, _, address = endpoint.partition("/")
    if set(endpoint) & set(PARAMETERS):
        raise ValueError(
            f"{endpoint} has parameters, which could switch mutual TLS off; write protocol/host:port alone"
        )
    if protocol in LOCAL_PROTOCOLS and address:
        return endpoint
    host, _, port = address.rpartition(":")
    if protocol not in NETWORK_PROTOCOLS or not host or not re.fullmatch(r"[0-9]{1,5}", port) or int(port) > 65535:
        raise ValueError(
            f"{endpoint} is not an endpoint; an endpoint has the form tcp/127.0.0.1:7447 or tls/10.0.0.5:7447"
        )
    return endpoint


Endpoint = Annotated[str, AfterValidator(check_endpoint)]


def is_loopback(endpoint: str) -> bool:
    """Return whether an endpoint can be reached from its own machine alone."""
    protocol, _, address = endpoint.partition("/")
    host = address.rpartition(":")[0].strip("[]")
    try:
        return protocol in LOCAL_PROTOCOLS or host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False  # a name may mean any address


def is_encrypted(endpoint: str) -> bool:
    """Return whether the links of an endpoint are encrypted and authenticated."""
    return endpoint.partition("/")[0] in ENCRYPTED_PROTOCOLS


class TlsSection(Section):
    """Certificates of mutual TLS, in PEM; `plumbline keys` makes them."""

    ca: Path | None = Field(None, description="certificate of the site's CA, which issues all others")
    certificate: Path | None = Field(None, description="certificate of this gateway")
    key: Path | None = Field(None, description="private key of this gateway")
    revoked: Path | None = Field(None, description="revocation list of the CA: its certificates may command nothing")

    @model_validator(mode="after")
    def _check_complete(self) -> Self:
        missing = [f"bus.tls.{name}" for name in ("ca", "certificate", "key") if name not in self.files]
        if 0 < len(missing) < 3:
            raise ValueError(f"mutual TLS needs ca, certificate and key; {' and '.join(missing)} missing")
        if self.revoked is not None and missing:
            raise ValueError("bus.tls.revoked needs bus.tls.ca, certificate and key")
        return self

    @property
    def files(self) -> dict[str, Path]:
        """The configured files by the names of their keys."""
        return {name: path for name in type(self).model_fields if (path := getattr(self, name)) is not None}

    @property
    def enabled(self) -> bool:
        """Whether certificates are configured."""
        return self.ca is not None


class AccessSection(Section):
    """Common names of certificates with rights on the link. Commands are authorised by their signature in any case."""

    operators: list[CommonName] = Field(
        default=[], description="may read; with services: nobody else may; default: every certificate of the site may"
    )
    services: list[CommonName] = Field(default=[], description="may read, and send every command")
    routers: list[CommonName] = Field(default=[], description="routers, which pass on what others send")
    load_signals: list[CommonName] = Field(default=[], description="may publish the load signal")


class BusSection(Section):
    """The connection to the Zenoh bus."""

    mode: Literal["peer", "client", "router"] = "peer"
    connect: list[Endpoint] = Field(default=[], description="endpoints to connect to, such as tls/10.0.0.5:7447")
    listen: list[Endpoint] = Field(
        default=["tcp/127.0.0.1:7447"], description="endpoints to listen on; default: only on this machine"
    )
    allow_unencrypted: bool = Field(
        False, description="listen beyond this machine without certificates: everyone on the network may read"
    )
    forward: list[SubtreeKey] = Field(
        default=[],
        description="other gateways that may publish through this one: plumbline/v1/<site>[/<crane>[/<sensor>]]",
    )
    tls: TlsSection = TlsSection()
    access: AccessSection = AccessSection()

    @model_validator(mode="after")
    def _check_exposure(self) -> Self:
        if self.mode == "client" and not self.connect:
            raise ValueError('mode = "client" needs bus.connect, the endpoints of the router')
        encrypted = [endpoint for endpoint in (*self.active_listeners, *self.connect) if is_encrypted(endpoint)]
        if encrypted and not self.tls.enabled:
            raise ValueError(f"{encrypted[0]} needs bus.tls.ca, certificate and key; plumbline keys makes them")
        exposed = self.exposed_listeners
        if exposed and not self.allow_unencrypted:
            raise ValueError(
                f"{exposed[0]} is open to the network without certificates; listen on tls/... with bus.tls, or on "
                "tcp/127.0.0.1:7447, or set bus.allow_unencrypted = true"
            )
        return self

    @property
    def active_listeners(self) -> list[str]:
        """The endpoints on which the gateway listens: none as a client."""
        return [] if self.mode == "client" else list(self.listen)

    @property
    def exposed_listeners(self) -> list[str]:
        """The listeners that are reachable from the network without encryption."""
        return [endpoint for endpoint in self.active_listeners if not (is_encrypted(endpoint) or is_loopback(endpoint))]

    @property
    def local_endpoints(self) -> list[str]:
        """The endpoints at which a process of this machine reaches the gateway or its router, loopback first."""
        listening = [endpoint.replace("/0.0.0.0:", "/127.0.0.1:") for endpoint in self.active_listeners]
        return sorted(listening, key=lambda endpoint: not is_loopback(endpoint)) or list(self.connect)


def find_problems(files: Mapping[str, Path]) -> Iterator[str]:
    """Yield what is wrong with the files of `bus.tls`, by the names of their keys, one line each."""
    unreadable = False
    for name, path in files.items():
        try:
            path.read_bytes()
        except OSError as error:
            unreadable = True
            yield f"bus.tls.{name}: {path}: cannot be read ({error.strerror}); plumbline keys issue makes it"
    if files and not unreadable and what_is_missing("security") is None:
        from gateway.pki.inspect import find_content_problems  # noqa: PLC0415 (its library is an extra)

        yield from find_content_problems(files)
