# SPDX-License-Identifier: GPL-3.0-or-later
"""Certificates for tests, made by the openssl program."""
import subprocess
from pathlib import Path


def openssl(*arguments, cwd):
    subprocess.run(["openssl", *map(str, arguments)], cwd=cwd, check=True, stdin=subprocess.DEVNULL,
                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


class Authority:
    """Signs certificates into a folder: NAME.pem and NAME.key."""

    def __init__(self, folder, name="ca"):
        self.folder, self.name = Path(folder), name
        openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2",
                "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.pem", cwd=folder)
        self.certificate = self.folder / f"{name}.pem"

    def sign(self, name, begin="20200101000000Z", end="20990101000000Z"):
        """@return (certificate, key)"""
        work = self.folder / f"ca-{self.name}-{name}"
        work.mkdir()
        (work / "index").touch()
        (work / "serial").write_text("01")
        (work / "conf").write_text(
            f"[ca]\ndefault_ca=d\n[d]\ndatabase=index\nserial=serial\nnew_certs_dir=.\ndefault_md=sha256\npolicy=p\n"
            f"x509_extensions=x\n[p]\ncommonName=supplied\n[x]\nsubjectAltName=IP:127.0.0.1,DNS:localhost\n")
        openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-subj", f"/CN={name}",
                "-keyout", f"../{name}.key", "-out", "request", cwd=work)
        openssl("ca", "-batch", "-notext", "-config", "conf", "-cert", f"../{self.name}.pem", "-keyfile", f"../{self.name}.key",
                "-startdate", begin, "-enddate", end, "-in", "request", "-out", f"../{name}.pem", cwd=work)
        return self.folder / f"{name}.pem", self.folder / f"{name}.key"
