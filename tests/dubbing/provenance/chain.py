"""A certificate chain of two, made for a test: nobody else trusts it."""

from __future__ import annotations

import datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from dubbing.provenance.signer import Signer

Pair = tuple[x509.Certificate, ec.EllipticCurvePrivateKey]


def write_chain(folder: Path, name: str = "signer") -> Signer:
    """``name``.pem and ``name``.key in a folder."""
    root = _certificate("test root", None)
    own, key = _certificate(name, root)
    certificate, secret = folder / f"{name}.pem", folder / f"{name}.key"
    certificate.write_bytes(b"".join(c.public_bytes(_PEM) for c in (own, root[0])))
    plain = serialization.NoEncryption()
    secret.write_bytes(key.private_bytes(_PEM, serialization.PrivateFormat.PKCS8, plain))
    return Signer(certificate, secret)


_PEM = serialization.Encoding.PEM


def _certificate(name: str, issuer: Pair | None) -> Pair:
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name(
        [
            x509.NameAttribute(NameOID.COMMON_NAME, name),
            x509.NameAttribute(NameOID.ORGANIZATION_NAME, "Test House"),
        ]
    )
    now = datetime.datetime.now(datetime.UTC)
    root = issuer is None
    above, signing = (subject, key) if issuer is None else (issuer[0].subject, issuer[1])
    usage = x509.KeyUsage(not root, False, False, False, False, root, root, False, False)
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(above)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=30))
        .add_extension(x509.BasicConstraints(root, None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(signing.public_key()), False
        )
    )
    if not root:
        purpose = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.EMAIL_PROTECTION])
        builder = builder.add_extension(purpose, critical=False)
    return builder.sign(signing, hashes.SHA256()), key
