"""A certificate that no client of OPC UA can use is refused at the start, with the file and the mend."""

import subprocess
from datetime import timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec

from gateway.bridge.opcua_certificate import check_identity
from gateway.bridge.opcua_security import trust_store
from gateway.bridge.settings import OpcuaSection
from gateway.errors import InputError
from tests.system.opcua_site import client_uri, issue

GUIDE = Path(__file__).parents[3] / "docs" / "guides" / "integrator" / "plant.md"


def test_the_line_of_the_guide_makes_a_certificate_that_can_be_used(tmp_path: Path) -> None:
    (line,) = [block for block in GUIDE.read_text().split("```") if block.startswith("sh\nopenssl req")]
    subprocess.run(["sh", "-ec", line.removeprefix("sh\n")], cwd=tmp_path, check=True, capture_output=True)
    assert check_identity(tmp_path / "server.der", tmp_path / "server-key.pem") == "urn:yard:plumbline-bridge"


def test_a_certificate_and_its_key_are_told_from_others(tmp_path: Path) -> None:
    certificate, key = issue(tmp_path, "server")
    assert check_identity(certificate, key) == client_uri("server")
    _, other = issue(tmp_path, "other")
    with pytest.raises(InputError, match=r"other-key.pem is not the key of .*server.der; name the two"):
        check_identity(certificate, other)
    with pytest.raises(InputError, match=r"server.der is no private key"):
        check_identity(certificate, certificate)
    with pytest.raises(InputError, match=r"server-key.pem is no certificate"):
        check_identity(key, key)
    with pytest.raises(InputError, match=r"nowhere is no certificate .*No such file"):
        check_identity(tmp_path / "nowhere", key)


def test_a_certificate_that_no_client_takes_is_refused(tmp_path: Path) -> None:
    old = issue(tmp_path, "old", lasts=-timedelta(days=1))
    with pytest.raises(InputError, match=r"old.der is valid from .* and not now"):
        check_identity(*old)
    curve = issue(tmp_path, "curve", key=ec.generate_private_key(ec.SECP256R1()))
    with pytest.raises(InputError, match=r"curve-key.pem is no RSA key"):
        check_identity(*curve)
    nameless = issue(tmp_path, "nameless", names=[x509.DNSName("gateway.yard")])
    with pytest.raises(InputError, match=r"nameless.der names no application URI"):
        check_identity(*nameless)


def test_a_folder_without_a_client_is_refused_and_a_file_that_is_none_named(tmp_path: Path) -> None:
    section = OpcuaSection(trusted=tmp_path)
    with pytest.raises(InputError, match=r"opcua.trusted: .* has no certificate \(\*.der, \*.pem\) of a client"):
        trust_store(section)
    (tmp_path / "scada.der").write_text("no certificate")
    with pytest.raises(InputError, match=r"opcua.trusted: .*scada.der is no certificate"):
        trust_store(section)
