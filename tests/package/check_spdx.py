#!/usr/bin/python3
"""Looks whether the SPDX list of an unpacked package has what SPDX 2.3 requires, and is true: every file
of the package with its hashes, and what dpkg-shlibdeps found that its programs need.
  check_spdx.py PACKAGE UNPACKED"""
import hashlib, json, pathlib, re, sys

package, root = sys.argv[1], pathlib.Path(sys.argv[2])
path = root / f"usr/share/doc/{package}/{package}.spdx.json"
document = json.loads(path.read_text(encoding="utf-8"))
control = (root / "DEBIAN/control").read_text(encoding="utf-8")
mistakes = []


def must(holds, words):
    if not holds:
        mistakes.append(words)


def has(thing, name, form=".+"):
    value = thing.get(name)
    must(isinstance(value, str) and re.fullmatch(form, value, re.S), f"{thing.get('SPDXID')}: {name} is {value!r}")


# The chapters of the specification: 6 document, 7 packages, 8 files, 11 relationships.
LICENSE = r"NONE|NOASSERTION|[A-Za-z0-9.+-]+"
IDENTIFIER = r"SPDXRef-[A-Za-z0-9.-]+"
has(document, "spdxVersion", r"SPDX-2\.3")
has(document, "dataLicense", r"CC0-1\.0")
has(document, "SPDXID", "SPDXRef-DOCUMENT")
has(document, "name")
has(document, "documentNamespace", r"[a-z]+://[^#\s]+")
has(document["creationInfo"], "created", r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")
must(document["creationInfo"]["creators"], "nobody has created it")
for creator in document["creationInfo"]["creators"]:
    must(re.match(r"(Person|Organization|Tool): \S", creator), f"the creator {creator!r} is of no kind")
for one in document["packages"]:
    has(one, "SPDXID", IDENTIFIER)
    has(one, "name")
    has(one, "versionInfo")
    has(one, "downloadLocation", r"NONE|NOASSERTION|[a-z+]+:.+")
    has(one, "supplier", r"NOASSERTION|(Person|Organization): .+")
    must(isinstance(one.get("filesAnalyzed"), bool), f"{one['SPDXID']}: does not say whether it lists its files")
    for reference in one["externalRefs"]:
        has(reference, "referenceCategory", "PACKAGE-MANAGER")
        has(reference, "referenceType", "purl")
        has(reference, "referenceLocator", r"pkg:deb/[a-z]+/[A-Za-z0-9.%-]+@[A-Za-z0-9.:%~-]+\?arch=[a-z0-9]+")
for one in document["files"]:
    has(one, "SPDXID", IDENTIFIER)
    has(one, "fileName", r"\./.+")
    has(one, "licenseConcluded", LICENSE)
    has(one, "copyrightText")
KINDS = {"DESCRIBES", "CONTAINS", "DEPENDS_ON", "STATIC_LINK", "BUILD_DEPENDENCY_OF", "BUILD_TOOL_OF"}
elements = ["SPDXRef-DOCUMENT"] + [one["SPDXID"] for one in document["packages"] + document["files"]]
must(len(elements) == len(set(elements)), "two elements have one SPDXID")
related = {kind: [] for kind in KINDS}
for one in document["relationships"]:
    must(one["relationshipType"] in KINDS, f"the relationship {one['relationshipType']} is none of {KINDS}")
    must({one["spdxElementId"], one["relatedSpdxElement"]} <= set(elements), f"{one} relates what is not there")
    related.setdefault(one["relationshipType"], []).append((one["spdxElementId"], one["relatedSpdxElement"]))

# The package itself.
itself = document["packages"][0]
must(related["DESCRIBES"] == [("SPDXRef-DOCUMENT", itself["SPDXID"])], "the document does not describe the package")
for field, name in (("Package", "name"), ("Version", "versionInfo")):
    must(f"{field}: {itself[name]}\n" in control, f"the {name} is {itself[name]!r}")
for name in ("licenseConcluded", "licenseDeclared"):
    must(itself[name] == "Apache-2.0", f"its {name} is {itself[name]!r}")
must(itself["filesAnalyzed"], "its files are not listed")
there = {f"./{file.relative_to(root)}": file.read_bytes() for file in root.rglob("*")
         if file.is_file() and file != path and root / "DEBIAN" not in file.parents}
listed = {one["fileName"]: {sum_["algorithm"]: sum_["checksumValue"] for sum_ in one["checksums"]}
          for one in document["files"]}
must(listed == {name: {"SHA1": hashlib.sha1(content).hexdigest(), "SHA256": hashlib.sha256(content).hexdigest()}
                for name, content in there.items()}, "the files or their hashes are not those of the package")
code = hashlib.sha1("".join(sorted(sums["SHA1"] for sums in listed.values())).encode()).hexdigest()
must(itself["packageVerificationCode"] == {
    "packageVerificationCodeValue": code,
    "packageVerificationCodeExcludedFiles": [f"./{path.relative_to(root)}"]}, "the verification code is wrong")
must(sorted(related["CONTAINS"]) == sorted((itself["SPDXID"], one["SPDXID"]) for one in document["files"]),
     "the package does not contain its files")

# What it is made of, by another finder and by name.
names = {one["SPDXID"]: one["name"] for one in document["packages"]}
depends = set(re.findall(r"[a-z0-9.+-]{2,}(?= \(|,|$)", re.search("^Depends: (.*)$", control, re.M)[1]))
loaded = {names.get(other) for _, other in related["DEPENDS_ON"]}
# A package may be depended on by a name that it provides: libspdlog1.10-fmt9.
strange = [name for name in loaded if not any(f"{one}-".startswith(f"{name}-") for one in depends)]
must(not strange, f"dpkg-shlibdeps did not find {strange}")
own = "libyaml-cpp0.7" if package == "previz-tools" else "libsystemd0"
must({"libc6", "libstdc++6", own} <= loaded, f"libraries are missing in {loaded}")
inside = {names.get(other) for _, other in related["STATIC_LINK"]}
must({"libcli11-dev", "libglm-dev", "nlohmann-json3-dev", "spirv-tools"} <= inside,
     f"what was compiled in is missing in {inside}")
tools = {names.get(tool) for tool, _ in related["BUILD_TOOL_OF"]}
must({"cmake", "glslang-tools", "spirv-tools"} <= tools, f"tools are missing in {tools}")

sys.exit("\n".join(f"check_spdx: {package}: {words}" for words in mistakes) or None)
