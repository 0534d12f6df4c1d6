#!/usr/bin/python3
"""Checks an Open Job Description job template, version 2023-09: its keys, types and limits by openjd.schema.json, then the
references between its parts. Needs Debian's python3-jsonschema and python3-yaml.

  tests/farm/check_openjd.py FILE      prints a line for each mistake; status 0 only if there is none

Sections are those of wiki/2023-09-Template-Schemas.md in github.com/OpenJobDescription/openjd-specifications.
"""

import json
import pathlib
import re
import sys

import jsonschema
import yaml

SCHEMA = pathlib.Path(__file__).with_name("openjd.schema.json")
INTERPOLATION = re.compile(r"\{\{(.*?)\}\}", re.DOTALL)
NAME = re.compile(r"\s*([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\s*", re.ASCII)
ELEMENT = re.compile(r"[ \t]*(-?\d+)(?:[ \t]*-[ \t]*(-?\d+)(?::(-?\d+))?)?[ \t]*", re.ASCII)
SESSION = {"Session.WorkingDirectory", "Session.HasPathMappingRules", "Session.PathMappingRulesFile"}


class UniqueKeys(yaml.SafeLoader):
    """Refuses a mapping in which a key stands twice, of which YAML's own loader keeps the last."""

    def construct_mapping(self, node, deep=False):
        keys = [self.construct_object(key, deep=deep) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(None, None, f'the key "{key}" stands twice', node.start_mark)
        return super().construct_mapping(node, deep)


def schema_mistakes(template):
    """The mistakes that the schema finds, each with the path of keys that leads to it."""
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    for error in jsonschema.Draft202012Validator(schema).iter_errors(template):
        best = jsonschema.exceptions.best_match([error])
        path = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in best.absolute_path)
        yield f"template{path}: {best.message}"


def strings_in(value):
    """Every string in a value, of whatever depth; a mapping's keys are no format strings."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for each in value.values():
            yield from strings_in(each)
    elif isinstance(value, list):
        for each in value:
            yield from strings_in(each)


def reference_mistakes(where, value, known):
    """The references of format strings (7.3) that name nothing which is known there."""
    for text in strings_in(value):
        for expression in INTERPOLATION.findall(text):
            name = NAME.fullmatch(expression)
            if not name:
                yield f'{where}: "{{{{{expression}}}}}" is no dotted name'
            elif name[1] not in known:
                yield f'{where}: "{{{{{expression}}}}}" is not defined there'
        if "{{" in INTERPOLATION.sub("", text):
            yield f'{where}: "{{{{" is not closed in "{text}"'


def repeated(names):
    return sorted({name for name in names if names.count(name) > 1})


def resolved(text, template):
    """A format string of the job's parameters with their defaults, or None where one has no default."""
    values = {}
    for parameter in template.get("parameterDefinitions", []):
        if "default" in parameter:
            values[f"Param.{parameter['name']}"] = values[f"RawParam.{parameter['name']}"] = str(parameter["default"])
    names = [expression.strip() for expression in INTERPOLATION.findall(text)]
    if any(name not in values for name in names):
        return None
    return INTERPOLATION.sub(lambda match: values[match[1].strip()], text)


def range_mistakes(where, text):
    """An integer range that is malformed or whose parts overlap (3.4.1.1.1)."""
    parts = []
    for element in text.split(","):
        match = ELEMENT.fullmatch(element)
        if not match or match[3] and int(match[3]) == 0:
            yield f'{where}: "{element}" is no integer range'
            return
        first, last = int(match[1]), int(match[2] if match[2] else match[1])
        parts.append((min(first, last), max(first, last), element.strip()))
    parts.sort()
    for (_, last, before), (first, _, after) in zip(parts, parts[1:]):
        if first <= last:
            yield f'{where}: the ranges "{before}" and "{after}" overlap'


def job_parameter_mistakes(template):
    """Defaults and limits of the job's parameters against one another (2)."""
    for parameter in template.get("parameterDefinitions", []):
        where = f"parameter {parameter['name']}"
        values = parameter.get("allowedValues", [])
        if "default" not in parameter:
            continue
        default = parameter["default"]
        if values and str(default) not in map(str, values):
            yield f'{where}: the default "{default}" is not among the allowed values'
        if parameter["type"] in ("STRING", "PATH"):
            if not parameter.get("minLength", 0) <= len(default) <= parameter.get("maxLength", 1024):
                yield f"{where}: the default is {len(default)} characters long, outside minLength and maxLength"
        else:
            low, high = float(parameter.get("minValue", "-inf")), float(parameter.get("maxValue", "inf"))
            if not low <= float(default) <= high:
                yield f'{where}: the default "{default}" is outside minValue and maxValue'


def step_mistakes(template, step, everywhere, on_hosts):
    """The references within a step: its parameters, requirements, environments and script (3)."""
    where = f"step \"{step['name']}\""
    space = step.get("parameterSpace", {})
    parameters = space.get("taskParameterDefinitions", [])
    names = [parameter["name"] for parameter in parameters]
    for name in repeated(names):
        yield f"{where}: two task parameters have the name {name}"
    yield from reference_mistakes(where, [parameters, step.get("hostRequirements", {})], everywhere)
    chunked = [parameter for parameter in parameters if parameter["type"] == "CHUNK[INT]"]
    if len(chunked) > 1:
        yield f"{where}: more than one task parameter is a chunk (3.4)"
    if chunked and "TASK_CHUNKING" not in template.get("extensions", []):
        yield f"{where}: CHUNK[INT] needs the extension TASK_CHUNKING (3.4.1)"
    for parameter in parameters:
        text = resolved(parameter["range"], template) if isinstance(parameter["range"], str) else None
        if text is not None:
            yield from range_mistakes(f"{where}, task parameter {parameter['name']}", text)
    if "combination" in space and sorted(re.findall(r"\w+", space["combination"])) != sorted(names):
        yield f"{where}: the combination does not name each task parameter once (3.4.3)"
    requirements = step.get("hostRequirements", {})
    if sum(map(len, requirements.values())) > 50:
        yield f"{where}: more than 50 host requirements (3.3)"
    for kind in requirements.values():
        for name in repeated([requirement["name"].lower() for requirement in kind]):
            yield f"{where}: two host requirements have the name {name} (3.3)"
    tasks = {f"Task.{kind}.{name}" for kind in ("Param", "RawParam") for name in names}
    yield from script_mistakes(where, step["script"], on_hosts | tasks, "Task")


def script_mistakes(where, script, known, owner):
    files = [file["name"] for file in script.get("embeddedFiles", [])]
    for name in repeated(files):
        yield f"{where}: two embedded files have the name {name}"
    yield from reference_mistakes(where, script, known | {f"{owner}.File.{name}" for name in files})


def environment_mistakes(environments, on_hosts):
    for environment in environments:
        where = f"environment \"{environment['name']}\""
        yield from reference_mistakes(where, environment.get("variables", {}), on_hosts)
        if "script" in environment:
            yield from script_mistakes(where, environment["script"], on_hosts, "Env")


def dependency_mistakes(steps):
    """Dependencies on steps that do not exist, and steps that wait for themselves (3.2)."""
    waits = {step["name"]: [each["dependsOn"] for each in step.get("dependencies", [])] for step in steps}
    for name, others in waits.items():
        for other in others:
            if other not in waits:
                yield f'step "{name}": it depends on "{other}", which is no step'
    done = set()
    while ready := {name for name in waits if name not in done and all(o in done for o in waits[name] if o in waits)}:
        done |= ready
    for name in waits:
        if name not in done:
            yield f'step "{name}": it waits for itself'


def mistakes(template):
    """All mistakes of a template; those between its parts only where the schema finds none."""
    found = list(schema_mistakes(template))
    if found:
        return found
    parameters = template.get("parameterDefinitions", [])
    # 7.3.1: a path is mapped only on a host.
    everywhere = {f"RawParam.{each['name']}" for each in parameters}
    everywhere |= {f"Param.{each['name']}" for each in parameters if each["type"] != "PATH"}
    on_hosts = everywhere | {f"Param.{each['name']}" for each in parameters} | SESSION

    for name in repeated([each["name"] for each in parameters]):
        found.append(f"two job parameters have the name {name}")
    for name in repeated([each["name"] for each in template["steps"]]):
        found.append(f'two steps have the name "{name}" (3)')
    shared = template.get("jobEnvironments", [])
    for step in template["steps"]:
        own = step.get("stepEnvironments", [])
        for name in repeated([each["name"] for each in shared + own]):
            found.append(f'step "{step["name"]}": two environments have the name "{name}" (3)')
        found += environment_mistakes(own, on_hosts)
        found += step_mistakes(template, step, everywhere, on_hosts)
    found += environment_mistakes(shared, on_hosts)
    found += reference_mistakes("name", template["name"], everywhere)
    name = resolved(template["name"], template)
    if name is not None and not 1 <= len(name) <= 128:
        found.append(f"name: it has {len(name)} characters where 1 to 128 are allowed (1.1.1)")
    found += job_parameter_mistakes(template)
    found += dependency_mistakes(template["steps"])
    return found


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    path = pathlib.Path(sys.argv[1])
    try:
        template = yaml.load(path.read_text(encoding="utf-8"), UniqueKeys)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        print(f"{path}: {error}", file=sys.stderr)
        return 1
    found = mistakes(template)
    for mistake in found:
        print(f"{path}: {mistake}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
