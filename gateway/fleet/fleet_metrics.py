"""The metrics of all gateways of a router on one endpoint, for gateways that a monitoring system cannot reach itself."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from gateway.fleet.gateway_status import STATE_LABELS, GatewayStatus
from gateway.page.metrics import Family, counter, gateway_families, gauge, labelled_gauge, render, with_labels
from gateway.page.verdict import PageEvidence


def format_fleet(
    evidence: Mapping[str, PageEvidence], statuses: Sequence[GatewayStatus], *, connected: bool, invalid: int
) -> str:
    """Return the metrics of every gateway with site, crane and sensor as labels, and those of the fleet."""
    return render([*_gateways(evidence), *_fleet(statuses, connected=connected, invalid=invalid)])


def _gateways(evidence: Mapping[str, PageEvidence]) -> Iterator[Family]:
    for key, each in evidence.items():
        yield from with_labels(gateway_families(each), _place(key))


def _fleet(statuses: Sequence[GatewayStatus], *, connected: bool, invalid: int) -> Iterator[Family]:
    counts = Counter(status.state for status in statuses)
    by_state = {label: counts[word] for word, label in STATE_LABELS.items()}
    yield labelled_gauge("fleet_gateways", "state", "Gateways by state.", by_state)
    for status in statuses:
        if status.state == "MISSING":
            missing = gauge("fleet_gateway_missing", "1 for an expected gateway that was never seen.", 1)
            yield from with_labels([missing], _place(status.key))
    yield gauge("fleet_router_connected", "1 while the router is connected.", connected)
    yield counter("fleet_invalid_messages", "Messages that were dropped because they were invalid.", invalid)


def _place(key: str) -> dict[str, str]:
    return dict(zip(("site", "crane", "sensor"), key.split("/")[-3:], strict=True))
