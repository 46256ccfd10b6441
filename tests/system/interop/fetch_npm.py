"""fetch_npm.py FOLDER: unpacks the packages of package-lock.json that are not optional into FOLDER/node_modules."""
import base64
import hashlib
import io
import json
import os
import pathlib
import shutil
import sys
import tarfile
import tempfile
import urllib.error
import urllib.request

LOCK = pathlib.Path(__file__).with_name("package-lock.json")
REGISTRY = os.environ.get("npm_config_registry", "https://registry.npmjs.org/").rstrip("/")
CANNOT_REACH = 75


def tarball(name, version, integrity):
    url = f"{REGISTRY}/{name}/-/{name.split('/')[-1]}-{version}.tgz"
    with urllib.request.urlopen(url, timeout=20) as answer:
        content = answer.read()
    kind, wanted = integrity.split("-", 1)
    if base64.b64encode(hashlib.new(kind, content).digest()).decode() != wanted:
        sys.exit(f"{url}: its {kind} is not that of {LOCK.name}")
    return content


def unpack(content, folder):
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        for member in archive:
            inside = pathlib.PurePosixPath(member.name).parts[1:]
            if not member.isfile() or ".." in inside:
                continue
            path = folder.joinpath(*inside)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(archive.extractfile(member).read())


def main(target):
    packages = json.loads(LOCK.read_text())["packages"]
    with tempfile.TemporaryDirectory(dir=target) as scratch:
        for place, package in packages.items():
            if place and not package.get("optional"):
                content = tarball(place.split("node_modules/")[-1], package["version"], package["integrity"])
                unpack(content, pathlib.Path(scratch) / place)
        os.rename(pathlib.Path(scratch) / "node_modules", target / "node_modules")
    shutil.copy(LOCK, target)


if __name__ == "__main__":
    try:
        main(pathlib.Path(sys.argv[1]))
    except (urllib.error.URLError, ConnectionError, TimeoutError) as error:
        if isinstance(error, urllib.error.HTTPError) and error.code < 500:
            sys.exit(f"{error.url}: {error}")
        print(f"{REGISTRY} cannot be reached: {error}", file=sys.stderr)
        sys.exit(CANNOT_REACH)
