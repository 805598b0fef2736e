"""A time stamp authority on loopback: `openssl ts` behind a small HTTP server, in a process of its own.

    python -m tests.system.time_stamp_authority FOLDER PORT

`make_authority` makes its CA and its certificate in a folder.
"""

import subprocess
import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory

SETTINGS = """
[req]
distinguished_name = name
[name]
[ca]
basicConstraints = critical, CA:TRUE
keyUsage = critical, keyCertSign
[stamps]
basicConstraints = CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = critical, timeStamping
[tsa]
default_tsa = authority
[authority]
dir = {folder}
serial = {folder}/serial
crypto_device = builtin
signer_cert = {folder}/tsa.pem
signer_key = {folder}/tsa.key
signer_digest = sha256
default_policy = 1.2.3.4.1
digests = sha256, sha512
ess_cert_id_alg = sha256
"""


def openssl(*arguments: str | Path) -> None:
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)


def make_authority(folder: Path) -> Path:
    """Return the certificate of the CA that has issued the authority's."""
    folder.mkdir()
    settings = folder / "openssl.cnf"
    settings.write_text(SETTINGS.format(folder=folder))
    (folder / "serial").write_text("01\n")
    new_key = "-newkey", "rsa:2048", "-nodes", "-config", settings
    files: list[str | Path] = ["-keyout", folder / "ca.key", "-out", folder / "ca.pem"]
    openssl("req", "-x509", *new_key, "-extensions", "ca", "-subj", "/CN=time CA", "-days", "30", *files)
    files = ["-keyout", folder / "tsa.key", "-out", folder / "tsa.csr"]
    openssl("req", *new_key, "-subj", "/CN=time stamp authority", *files)
    issuer = "-CA", folder / "ca.pem", "-CAkey", folder / "ca.key", "-CAcreateserial", "-days", "30"
    extensions = "-extfile", settings, "-extensions", "stamps"
    openssl("x509", "-req", "-in", folder / "tsa.csr", *issuer, *extensions, "-out", folder / "tsa.pem")
    return folder / "ca.pem"


class Handler(BaseHTTPRequestHandler):
    """Answers a query with a time stamp."""

    folder: Path

    def do_POST(self) -> None:
        query = self.rfile.read(int(self.headers["Content-Length"]))
        with TemporaryDirectory() as name:
            asked, answer = Path(name) / "query.tsq", Path(name) / "answer.tsr"
            asked.write_bytes(query)
            openssl("ts", "-reply", "-config", self.folder / "openssl.cnf", "-queryfile", asked, "-out", answer)
            content = answer.read_bytes()
        self.send_response(200)
        self.send_header("Content-Type", "application/timestamp-reply")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)


if __name__ == "__main__":
    Handler.folder = Path(sys.argv[1])
    with HTTPServer(("127.0.0.1", int(sys.argv[2])), Handler) as server:
        print("ready", flush=True)
        server.serve_forever()
