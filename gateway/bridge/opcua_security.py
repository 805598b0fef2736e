"""Who may connect: applications whose certificate is trusted, and users by password or certificate; nobody without a name."""

import hmac
import logging

from asyncua import Server, ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import SimpleRoleRuleset, User, UserRole
from asyncua.crypto.truststore import TrustStore
from asyncua.crypto.uacrypto import x509_from_der
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions
from asyncua.server.address_space import MethodService
from cryptography import x509

from gateway.bridge.opcua_certificate import check_identity, load_x509
from gateway.bridge.settings import OpcuaSection
from gateway.errors import InputError

log = logging.getLogger("plumbline.opcua")
POLICIES = [
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
]
CHECKED = (
    CertificateValidatorOptions.TIME_RANGE
    | CertificateValidatorOptions.URI
    | CertificateValidatorOptions.TRUSTED
    | CertificateValidatorOptions.REVOKED
    | CertificateValidatorOptions.PEER_CLIENT
)
COMMANDS = [
    ua.NodeId(ua.ObjectIds.ConditionType_Enable),
    ua.NodeId(ua.ObjectIds.ConditionType_Disable),
    ua.NodeId(ua.ObjectIds.ConditionType_AddComment),
    ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge),
    ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Confirm),
]
"""The methods of a condition that change it. Definition: OPC 10000-9, sections 5.5.2 and 5.7.2."""


class ReadingMethods:
    """Refuses commands, whatever condition they are for: a gateway takes them with a credential of its own alone."""

    def __init__(self, service: MethodService) -> None:
        """`service` answers the other methods."""
        self._service = service

    async def call(self, methods: list[ua.CallMethodRequest]) -> list[ua.CallMethodResult]:
        """Return the results of calls. Called by the library, as `stop` is."""
        return [await self._call(each) for each in methods]

    async def _call(self, method: ua.CallMethodRequest) -> ua.CallMethodResult:
        if method.MethodId in COMMANDS:
            return ua.CallMethodResult(StatusCode=ua.StatusCode(ua.StatusCodes.BadUserAccessDenied))
        return (await self._service.call([method]))[0]

    def stop(self) -> None:
        """End it."""
        self._service.stop()


class PlantUsers:
    """Knows one user by password, and those whose certificates are trusted. All may read and nothing else."""

    def __init__(self, name: str | None, password: str | None, trusted: TrustStore) -> None:
        self._name, self._password, self._trusted = name, password, trusted

    def get_user(
        self,
        iserver: object,
        username: str | None = None,
        password: str | None = None,
        certificate: bytes | None = None,
    ) -> User | None:
        """Return the user; None refuses. Called by the library, for a certificate after it has checked the signature."""
        del iserver
        if username is not None:
            known = self._name is not None and self._password is not None and password is not None
            if known and username == self._name and hmac.compare_digest(str(password), str(self._password)):
                return User(role=UserRole.User, name=username)
        elif certificate is not None and self._trusted.validate(x509_from_der(certificate)):
            return User(role=UserRole.User, name="certificate")
        log.warning("a user is refused: %s", "certificate" if username is None else username)
        return None


async def secure(server: Server, section: OpcuaSection, users_of: TrustStore) -> None:
    """Let a server take encrypted links of trusted applications and named users alone. Raises `InputError`."""
    if section.certificate is None or section.key is None:
        raise InputError("opcua.certificate and opcua.key are needed: a certificate of this server with an RSA key")
    uri = check_identity(section.certificate, section.key)
    try:
        await users_of.load()
    except (OSError, ValueError) as error:
        raise InputError(f"opcua.revoked: {section.revoked} has a file that is no revocation list: {error}") from error
    await server.load_certificate(section.certificate)
    await server.load_private_key(section.key)
    await server.set_application_uri(uri)
    server.set_security_policy(POLICIES, permission_ruleset=SimpleRoleRuleset())
    server.set_identity_tokens([ua.X509IdentityToken, ua.UserNameIdentityToken])
    checker = CertificateValidator(CHECKED, users_of)

    async def validate(certificate: x509.Certificate, application: ua.ApplicationDescription) -> None:
        try:
            await _read_again(users_of)
            await checker.validate(certificate, application)
        except ServiceError as error:
            log.warning(
                "a client is refused: %s, %s", certificate.subject.rfc4514_string(), ua.StatusCode(error.code).name
            )
            raise

    server.set_certificate_validator(validate)


def trust_store(section: OpcuaSection) -> TrustStore:
    """Return the store of the certificates in the folders of the settings; it is loaded later. Raises `InputError`."""
    if section.trusted is None or not section.trusted.is_dir():
        raise InputError("opcua.trusted is needed: a folder with the certificates of the clients, or of their CA")
    files = [each for each in sorted(section.trusted.glob("*.*")) if each.suffix.lower() in (".der", ".pem")]
    if not files:
        raise InputError(
            f"opcua.trusted: {section.trusted} has no certificate (*.der, *.pem) of a client, or of its CA; put one there"
        )
    for each in files:
        load_x509(each, "opcua.trusted")
    return TrustStore([section.trusted], [] if section.revoked is None else [section.revoked])


async def _read_again(users_of: TrustStore) -> None:
    """Read the folders anew: who was taken out of them is refused. Raises `ServiceError` where they cannot be read."""
    try:
        await users_of.load()
    except (OSError, ValueError) as error:
        log.error("opcua.trusted, revoked: nobody is trusted: %s", error)
        raise ServiceError(ua.StatusCodes.BadCertificateUntrusted) from error
