#!/usr/bin/python3
"""Writes usr/share/doc/PACKAGE/PACKAGE.spdx.json (SPDX 2.3) into the folder of a package's files, before
they are packed: every file with its hashes, the libraries that its programs load, the Debian packages
whose headers and archives Ninja compiled and linked into them, and the tools that did. The same files,
packages and SOURCE_DATE_EPOCH give the same bytes.
  spdx.py BUILD DEBIAN TOOL... --package NAME VERSION FILES
BUILD is CMake's folder, DEBIAN has the file `copyright`, a TOOL is a program."""
import datetime, hashlib, json, os, pathlib, re, subprocess, sys
from urllib.parse import quote


def lines(*command, cwd=None, may_fail=False):
    """The lines that a command prints."""
    done = subprocess.run(command, cwd=cwd, stdout=subprocess.PIPE, text=True, check=not may_fail,
                          stderr=subprocess.DEVNULL if may_fail else None)
    return done.stdout.splitlines()


def owners(paths, may_lack=False):
    """The installed Debian packages, as NAME or NAME:ARCHITECTURE, that have these files; a compiler may be of none."""
    real = {os.path.realpath(path) for path in paths}
    # dpkg knows a file of /usr/lib by the path that its package gave it, which may be /lib.
    asked = real | {path.removeprefix("/usr") for path in real}
    found = {}
    for line in lines("dpkg-query", "--search", *sorted(asked), may_fail=True):
        names, path = line.rsplit(": ", 1)
        if not names.startswith("diversion by"):
            found[path] = names.split(", ")[0]
    lost = sorted(path for path in real if path not in found and path.removeprefix("/usr") not in found)
    if lost and not may_lack:
        sys.exit(f"spdx: these are of no Debian package: {' '.join(lost)}")
    return set(found.values())


def loaded(program):
    """The paths of the libraries that a program names itself."""
    needed = {line.split()[1] for line in lines("objdump", "-p", program) if "  NEEDED " in line}
    return {line.split()[2] for line in lines("ldd", program) if line.split()[0] in needed and "=>" in line}


def compiled_in(build, target):
    """The system's headers that a target was compiled from, and its archives."""
    ninja = ["ninja", "-n", "-t"]
    inputs = lines(*ninja, "inputs", target, cwd=build)
    objects = [name for name in inputs if name.endswith((".o", ".gch"))]
    headers = {line.strip() for line in lines(*ninja, "deps", *objects, cwd=build)}
    return ({path for path in headers if path.startswith("/usr/")},
            {path for path in inputs if path.startswith("/usr/") and path.endswith(".a")})


def has_shared_library(package):
    return any(path.endswith(".so") for path in lines("dpkg-query", "--listfiles", package))


def identifier(name):
    return "SPDXRef-" + re.sub("[^A-Za-z0-9.-]", "-", name)


def debian_package(name):
    form = "${Package}\t${Version}\t${Architecture}\t${source:Package}\t${source:Version}"
    name, version, architecture, source, source_version = lines("dpkg-query", "--show", f"--showformat={form}",
                                                                name)[0].split("\t")
    return {
        "SPDXID": identifier(f"Package-{name}-{architecture}"), "name": name, "versionInfo": version,
        "supplier": "Organization: Debian", "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
        "sourceInfo": f"built package from: {source} {source_version}",
        "externalRefs": [package_url(name, version, architecture)]}


def package_url(name, version, architecture, vendor="debian"):
    return {"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
            "referenceLocator": f"pkg:deb/{vendor}/{quote(name)}@{quote(version, safe=':')}?arch={architecture}"}


def main(build, debian, tools, package, version, root):
    notes = (pathlib.Path(debian) / "copyright").read_text(encoding="utf-8")
    copyright_text, license_name = re.search(r"^Files: \*\nCopyright: (.*)\nLicense: (.*)$", notes, re.M).groups()
    rights = {"licenseConcluded": license_name, "copyrightText": copyright_text}
    to = root / "usr/share/doc" / package / f"{package}.spdx.json"

    files = []
    programs = []
    for path in sorted(path for path in root.rglob("*") if path.is_file() and path != to):
        content = path.read_bytes()
        if content.startswith(b"\x7fELF"):
            programs.append(path)
        files.append({
            "SPDXID": f"SPDXRef-File-{len(files) + 1}", "fileName": f"./{path.relative_to(root)}",
            "checksums": [{"algorithm": "SHA1", "checksumValue": hashlib.sha1(content).hexdigest()},
                          {"algorithm": "SHA256", "checksumValue": hashlib.sha256(content).hexdigest()}],
            **rights})
    hashes = "".join(sorted(file["checksums"][0]["checksumValue"] for file in files))

    libraries, headers, archives = set(), set(), set()
    for program in programs:
        libraries |= loaded(program)
        for paths, more in zip((headers, archives), compiled_in(build, program.name)):
            paths |= more
    header_packages = owners(headers)
    # Of a package without a shared library, whatever is used has become part of the program.
    inside = {name for name in header_packages if not has_shared_library(name)} | owners(archives)
    kinds = {"DEPENDS_ON": owners(libraries), "STATIC_LINK": inside,
             "BUILD_DEPENDENCY_OF": header_packages - inside, "BUILD_TOOL_OF": owners(tools, may_lack=True)}
    others = {name: debian_package(name) for name in sorted(set().union(*kinds.values()))}

    architecture = lines("dpkg", "--print-architecture")[0]
    itself = {
        "SPDXID": identifier(f"Package-{package}"), "name": package, "versionInfo": version,
        "supplier": f"Organization: {copyright_text.split(maxsplit=2)[2]}", "downloadLocation": "NOASSERTION",
        "filesAnalyzed": True,
        "packageVerificationCode": {"packageVerificationCodeValue": hashlib.sha1(hashes.encode()).hexdigest(),
                                    "packageVerificationCodeExcludedFiles": [f"./{to.relative_to(root)}"]},
        **rights, "licenseDeclared": license_name, "licenseInfoFromFiles": ["NOASSERTION"],
        "primaryPackagePurpose": "APPLICATION",
        "externalRefs": [package_url(package, version, architecture, "previzd")]}

    relationships = []
    def relate(one, kind, other):
        relationships.append({"spdxElementId": one, "relationshipType": kind, "relatedSpdxElement": other})
    relate("SPDXRef-DOCUMENT", "DESCRIBES", itself["SPDXID"])
    for file in files:
        relate(itself["SPDXID"], "CONTAINS", file["SPDXID"])
    for kind, names in kinds.items():
        for name in sorted(names):
            ends = itself["SPDXID"], others[name]["SPDXID"]
            relate(*((ends[1], kind, ends[0]) if kind.endswith("_OF") else (ends[0], kind, ends[1])))

    created = datetime.datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), datetime.timezone.utc)
    document = {
        "spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"{package}-{version}",
        "creationInfo": {"created": created.strftime("%Y-%m-%dT%H:%M:%SZ"),
                         "creators": [f"Tool: previzd-{version}/systemd/package/spdx.py", itself["supplier"]]},
        "packages": [itself, *others.values()], "files": files, "relationships": relationships}
    digest = hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
    document["documentNamespace"] = f"https://previz.example/spdx/{package}-{version}-{digest}"
    to.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    to.chmod(0o644)  # whatever the umask is


split = sys.argv.index("--package")
main(*sys.argv[1:3], sys.argv[3:split], *sys.argv[split + 1:-1], pathlib.Path(sys.argv[-1]))
