#!/usr/bin/python3
"""Tests check_openjd.py: with a template that is right, and with that template broken in one place at a time."""

import copy
import pathlib
import tempfile
import unittest

import yaml

import check_openjd

GOOD = """
specificationVersion: jobtemplate-2023-09
extensions: [TASK_CHUNKING]
name: "take, frames {{Param.Frames}}"
parameterDefinitions:
  - {name: Take, type: PATH, objectType: DIRECTORY, dataFlow: IN, default: "/takes/a \\"b\\"\\nc"}
  - {name: Pictures, type: PATH, objectType: DIRECTORY, dataFlow: OUT}
  - {name: Frames, type: STRING, default: "0-99", userInterface: {control: LINE_EDIT, label: Frames}}
  - {name: FramesInATask, type: INT, minValue: 1, default: "10"}
  - {name: Scale, type: FLOAT, minValue: 0.05, maxValue: "1.0", default: 0.5}
jobEnvironments:
  - {name: threads, variables: {OMP_NUM_THREADS: "4"}}
steps:
  - name: Render
    hostRequirements:
      amounts: [{name: amount.worker.memory, min: 2048}]
      attributes: [{name: attr.worker.os.family, anyOf: [linux]}]
    parameterSpace:
      taskParameterDefinitions:
        - name: Frames
          type: CHUNK[INT]
          range: "{{Param.Frames}}"
          chunks: {defaultTaskCount: "{{Param.FramesInATask}}", rangeConstraint: CONTIGUOUS}
        - {name: Eye, type: STRING, range: [left, right]}
      combination: Frames * Eye
    script:
      actions:
        onRun:
          command: "{{Task.File.Run}}"
          args: ["{{Param.Take}}", "{{ Task.Param.Frames }}", --out, "{{Param.Pictures}}", "", "{{Task.Param.Eye}}"]
          timeout: 3600
          cancelation: {mode: NOTIFY_THEN_TERMINATE, notifyPeriodInSeconds: 30}
      embeddedFiles:
        - {name: Run, type: TEXT, runnable: true, data: "cd {{Session.WorkingDirectory}}"}
  - name: Check
    dependencies: [{dependsOn: Render}]
    script:
      actions:
        onRun: {command: "true", args: ["{{RawParam.Pictures}}"], cancelation: {mode: TERMINATE}}
"""


def parameter(index, **keys):
    return lambda t: t["parameterDefinitions"][index].update(keys)


def step(index, **keys):
    return lambda t: t["steps"][index].update(keys)


def run(index, **keys):
    return lambda t: t["steps"][index]["script"]["actions"]["onRun"].update(keys)


def frames(**keys):
    return lambda t: t["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0].update(keys)


def space(**keys):
    return lambda t: t["steps"][0]["parameterSpace"].update(keys)


# What breaks the template, and a part of the message that reports it.
BROKEN = [
    (lambda t: t.update(specificationVersion="jobtemplate-2024-01"), "specificationVersion"),
    (lambda t: t.pop("steps"), "'steps' is a required property"),
    (lambda t: t.update(owner="me"), "'owner' was unexpected"),
    (lambda t: t.update(extensions=[]), "extensions"),
    (lambda t: t.update(extensions=["EXPR"]), "extensions"),
    (lambda t: t.pop("extensions"), "needs the extension TASK_CHUNKING"),
    (lambda t: t.update(name=""), "name"),
    (lambda t: t.update(name="two\nlines"), "name"),
    (lambda t: t.update(name="x" * 129), "129 characters"),
    (lambda t: t.update(name="{{Param.Take}}"), '"{{Param.Take}}" is not defined there'),
    (lambda t: t.update(name="{{Param.Frames"), "is not closed"),
    (lambda t: t.update(name="{{1 + 1}}"), "is no dotted name"),
    (lambda t: t.update(parameterDefinitions=[]), "parameterDefinitions"),
    (lambda t: t.update(parameterDefinitions=t["parameterDefinitions"] * 11), "parameterDefinitions"),
    (lambda t: t["parameterDefinitions"].append({"name": "Take", "type": "INT"}), "have the name Take"),
    (lambda t: t["jobEnvironments"].append({"name": "empty"}), "jobEnvironments[1]"),
    (lambda t: t["jobEnvironments"].append({"name": "threads", "variables": {}}), 'have the name "threads"'),
    (lambda t: t["jobEnvironments"][0].update(variables={"2ND": ""}), "2ND"),
    (parameter(0, name="the take"), "parameterDefinitions[0].name"),
    (parameter(0, name="Take\n"), "parameterDefinitions[0].name"),
    (parameter(0, type="FOLDER"), "parameterDefinitions[0].type"),
    (parameter(0, dataFlow="BOTH"), "parameterDefinitions[0].dataFlow"),
    (parameter(0, default="x" * 1025), "parameterDefinitions[0].default"),
    (parameter(0, minValue=1), "'minValue' was unexpected"),
    (parameter(2, allowedValues=["0-9"]), "not among the allowed values"),
    (parameter(2, maxLength=3), "4 characters long"),
    (parameter(2, default="0-99,50"), 'the ranges "0-99" and "50" overlap'),
    (parameter(2, default="first-last"), "is no integer range"),
    (parameter(3, default="ten"), "parameterDefinitions[3].default"),
    (parameter(3, default=True), "parameterDefinitions[3].default"),
    (parameter(3, default=0), "outside minValue"),
    (parameter(4, default="2.0"), "outside minValue and maxValue"),
    (step(0, name="x" * 65), "steps[0].name"),
    (step(0, name="Check"), 'two steps have the name "Check"'),
    (step(0, hostRequirements={}), "hostRequirements"),
    (step(0, hostRequirements={"amounts": [{"name": "amount.worker.gpu"}]}), "hostRequirements"),
    (step(0, hostRequirements={"amounts": [{"name": "worker.gpu", "min": 1}]}), "hostRequirements"),
    (step(0, dependencies=[{"dependsOn": "Check"}]), "it waits for itself"),
    (step(1, dependencies=[{"dependsOn": "Renders"}]), '"Renders", which is no step'),
    (step(1, dependencies=[]), "dependencies"),
    (step(1, dependencies=["Render"]), "dependencies"),
    (step(1, parameterSpace={"taskParameterDefinitions": []}), "taskParameterDefinitions"),
    (frames(name="Picture"), '"{{ Task.Param.Frames }}" is not defined there'),
    (frames(range="1-5:0"), "range"),
    (frames(range="1-10:4,10-15"), "overlap"),
    (frames(range=[]), "range"),
    (frames(range=list(range(1025))), "range"),
    (frames(range="{{Task.Param.Eye}}"), '"{{Task.Param.Eye}}" is not defined there'),
    (frames(chunks={"defaultTaskCount": 0, "rangeConstraint": "CONTIGUOUS"}), "chunks.defaultTaskCount"),
    (frames(chunks={"defaultTaskCount": 1}), "'rangeConstraint' is a required property"),
    (frames(type="INT"), "chunks"),
    (lambda t: t["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0].pop("chunks"), "'chunks' is a required"),
    (space(combination="Frames"), "does not name each task parameter once"),
    (run(0, command=""), "onRun.command"),
    (run(0, args=["two\nlines"]), "onRun.args[0]"),
    (run(0, args=[1]), "onRun.args[0]"),
    (run(0, args=["{{Param.Seed}}"]), '"{{Param.Seed}}" is not defined there'),
    (run(0, args=["{{Env.File.Run}}"]), '"{{Env.File.Run}}" is not defined there'),
    (run(0, timeout=0), "onRun.timeout"),
    (run(0, timeout="60"), "onRun.timeout"),
    (run(0, cancelation={"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": 601}), "onRun.cancelation"),
    (run(0, cancellation={"mode": "TERMINATE"}), "'cancellation' was unexpected"),
    (run(1, args=["{{Task.Param.Frames}}"]), '"{{Task.Param.Frames}}" is not defined there'),
]


class CheckOpenjd(unittest.TestCase):
    def test_right_template_has_no_mistakes(self):
        self.assertEqual(check_openjd.mistakes(yaml.safe_load(GOOD)), [])

    def test_smallest_template_has_no_mistakes(self):
        smallest = {"specificationVersion": "jobtemplate-2023-09", "name": "n",
                    "steps": [{"name": "s", "script": {"actions": {"onRun": {"command": "true"}}}}]}
        self.assertEqual(check_openjd.mistakes(smallest), [])

    def test_broken_template_is_refused_with_the_reason(self):
        for index, (breaks, message) in enumerate(BROKEN):
            with self.subTest(index=index, message=message):
                template = copy.deepcopy(yaml.safe_load(GOOD))
                breaks(template)
                self.assertIn(message, "\n".join(check_openjd.mistakes(template)))

    def test_examples_of_integer_ranges(self):
        # The table of section 3.4.1.1.1.
        for text in ("1 - 5", "1 - -1", "-1 - 1", "1-5:2", "10-15:2,1-5", "1-10:4"):
            with self.subTest(text=text):
                template = yaml.safe_load(GOOD)
                frames(range=text)(template)
                self.assertEqual(check_openjd.mistakes(template), [])

    def test_key_that_stands_twice_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "template.yaml"
            file.write_text(GOOD + "name: again\n", encoding="utf-8")
            with self.assertRaisesRegex(yaml.YAMLError, 'the key "name" stands twice'):
                yaml.load(file.read_text(encoding="utf-8"), check_openjd.UniqueKeys)


if __name__ == "__main__":
    unittest.main()
