"""The package against the command, through tables, and under Ctrl-C. Run by tests/suite/python.rs.

python -m unittest discover --start-directory crates/python/tests

Environment: SURMISE_DIAGNOSE is the program `diagnose` of the same build; without it what compares with it is skipped.
"""

import ast
import csv
import json
import os
import re
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import surmise

ROOT = Path(__file__).resolve().parents[3]
TILT = ROOT / "tests/data/mujoco-logs/logs/set-003"
PROGRAM = os.environ.get("SURMISE_DIAGNOSE")
NOTEBOOK = ROOT / "docs/src/guides/python.ipynb"

try:
    import polars
except ImportError:
    polars = None


def short_log(folder, episodes=6, rows=64):
    """The first rows of the first episodes of the log with a tilted table: a diagnosis runs, whatever it says."""
    (folder / "log.toml").write_bytes((TILT / "log.toml").read_bytes())
    seen = {}
    with open(TILT / "samples.csv", newline="") as read, open(folder / "samples.csv", "w", newline="") as write:
        reader, writer = csv.reader(read), csv.writer(write, lineterminator="\n")
        writer.writerow(next(reader))
        for row in reader:
            seen[row[0]] = seen.get(row[0], 0) + 1
            if seen[row[0]] <= rows and len(seen) <= episodes:
                writer.writerow(row)
    return folder


def setUpModule():
    global FOLDER, LOG, STAGES, DIAGNOSIS
    unittest.addModuleCleanup((scratch := tempfile.TemporaryDirectory()).cleanup)
    FOLDER = Path(scratch.name)
    (FOLDER / "log").mkdir()
    LOG = surmise.read_log(short_log(FOLDER / "log"))
    STAGES = []
    DIAGNOSIS = surmise.diagnose(LOG, seed=2, threads=1, progress=lambda *told: STAGES.append(told))


def without_duration(name, data):
    """The bytes of a result, but for how long it took."""
    if name == "report.json":
        return re.sub(rb'"seconds": [0-9.e-]+', b"", data)
    if name == "report.html":
        return re.sub(rb", [0-9.,]+ s\. Version", b"", data)
    return data


class Answers(unittest.TestCase):
    @unittest.skipUnless(PROGRAM, "SURMISE_DIAGNOSE does not name the program")
    def test_wrong_arguments_are_named_with_what_was_expected(self):
        log = surmise.read_log(TILT)
        cases = [
            (TypeError, "header: expected a mapping", lambda: surmise.Log.from_pandas({}, 3)),
            (TypeError, "log: expected a Log", lambda: surmise.diagnose("x")),
            (ValueError, "threads: expected a whole number", lambda: surmise.diagnose(log, threads=-1)),
            (ValueError, "seed: expected a whole number", lambda: surmise.diagnose(log, seed=0.5)),
            (ValueError, "fold: expected .i, k.", lambda: surmise.diagnose(log, fold="3/2")),
            (ValueError, "fold: expected .i, k.", lambda: surmise.diagnose(log, fold=(3, 2))),
        ]
        for kind, words, call in cases:
            with self.subTest(words), self.assertRaisesRegex(kind, words):
                call()

    def test_results_are_those_of_the_command_but_for_the_duration(self):
        mine, its = FOLDER / "mine", FOLDER / "its"
        DIAGNOSIS.save(mine)
        command = [PROGRAM, "--measured", str(FOLDER / "log"), "--seed", "2", "--out", str(its)]
        subprocess.run(command, check=True, capture_output=True)
        self.assertEqual(sorted(os.listdir(mine)), sorted(os.listdir(its)))
        for name in sorted(os.listdir(its)):
            ours, theirs = (without_duration(name, (folder / name).read_bytes()) for folder in (mine, its))
            self.assertEqual(ours, theirs, name)
        self.assertEqual(DIAGNOSIS.model.toml, (its / "model.toml").read_text())
        # The command takes the folder for its own.
        DIAGNOSIS.save(its)

    @unittest.skipUnless(PROGRAM, "SURMISE_DIAGNOSE does not name the program")
    def test_an_error_is_the_sentence_of_the_command(self):
        broken = FOLDER / "broken"
        broken.mkdir()
        (broken / "log.toml").write_bytes((TILT / "log.toml").read_bytes())
        (broken / "samples.csv").write_text("episode,time_secs,object_x_mm\n0,0,1\n")
        with self.assertRaises(surmise.LogError) as caught:
            surmise.read_log(broken)
        self.assertIsInstance(caught.exception, ValueError)
        its = subprocess.run([PROGRAM, "--measured", str(broken)], capture_output=True, text=True)
        self.assertEqual(its.returncode, 2)
        self.assertIn(str(caught.exception), its.stderr)
        self.assertIn("object_x_m", str(caught.exception))

    def test_attributes_are_those_of_the_report(self):
        report = json.loads((DIAGNOSIS.save(FOLDER / "saved"), FOLDER / "saved/report.json")[1].read_text())
        self.assertEqual(DIAGNOSIS.report, report)
        self.assertEqual(DIAGNOSIS.verdict, report["verdict"])
        self.assertEqual([effect.name for effect in DIAGNOSIS.effects], [e["name"] for e in report["effects"]])
        self.assertEqual([cell.share for cell in DIAGNOSIS.located], [c["share"] for c in report["located"]])
        self.assertEqual(DIAGNOSIS.heldout.before, report["heldout"]["before"])
        self.assertEqual(len(DIAGNOSIS.warnings), len(report["warnings"]))
        self.assertEqual(DIAGNOSIS.confusion_set, report["confusion_set"])
        frame = DIAGNOSIS.to_pandas()
        self.assertEqual(len(frame), sum(len(e["parameters"]) for e in report["effects"]))
        located = DIAGNOSIS.to_pandas("located")
        self.assertEqual(list(located.share), [c["share"] for c in report["located"]])
        shown = DIAGNOSIS._repr_html_()
        self.assertTrue(shown.startswith("<iframe") and "&lt;h1" in shown and "<h1" not in shown)
        with self.assertRaisesRegex(surmise.LogError, "holds"):
            DIAGNOSIS.save(FOLDER / "log")

    def test_a_model_simulates_its_log_and_begins_the_next_diagnosis(self):
        table = DIAGNOSIS.model.simulate(LOG)
        self.assertEqual(table.rows, LOG.columns().rows)
        self.assertEqual(list(table["measured_object_x_m"]), list(LOG.columns()["object_x_m"]))
        frame = table.to_pandas()
        self.assertLess((frame.measured_object_x_m - frame.simulated_object_x_m).abs().max(), 0.2)
        self.assertIn("simulated_tool_z_m", frame)
        residuals = DIAGNOSIS.to_pandas("residuals")
        self.assertEqual(len(residuals), table.rows)
        self.assertLess(residuals.after_angle_rad.median(), 0.5)
        (FOLDER / "model.toml").write_text(DIAGNOSIS.model.toml)
        read = surmise.read_model(FOLDER / "model.toml")
        self.assertEqual(read.toml, DIAGNOSIS.model.toml)
        self.assertEqual(bytes(read.simulate(LOG)["simulated_object_y_m"]), bytes(table["simulated_object_y_m"]))
        (FOLDER / "model.toml").write_text("version = 1\n[nominal]\nmass = 1\n")
        with self.assertRaisesRegex(surmise.LogError, "model.toml: key `nominal.mass`: expected one of"):
            surmise.diagnose(LOG, model=FOLDER / "model.toml")


class Tables(unittest.TestCase):
    def same(self, frame, header=None):
        log = surmise.Log.from_pandas(frame, LOG.header if header is None else header)
        ours, theirs = log.columns(), LOG.columns()
        self.assertEqual(list(ours), list(theirs))
        for name in theirs:
            self.assertEqual(bytes(ours[name]), bytes(theirs[name]), name)
        return log

    def test_a_log_survives_pandas_and_plain_lists(self):
        frame = LOG.to_pandas()
        self.assertEqual(str(frame.episode.dtype), "int64")
        self.same(frame)
        self.same(frame.convert_dtypes())
        self.same({name: [None if cell != cell else cell for cell in cells] for name, cells in LOG.columns().items()})

    def test_a_log_is_held_against_what_its_readings_say(self):
        log = surmise.read_log(TILT)
        self.assertEqual(log.check()["suspicions"], [])
        columns = {name: list(cells) for name, cells in log.columns().items()}
        for name in ("wrist_fx_n", "wrist_fy_n", "wrist_fz_n"):
            columns[name] = [-cell for cell in columns[name]]
        found = surmise.Log.from_pandas(columns, log.header).check()["suspicions"]
        self.assertEqual([suspicion["kind"] for suspicion in found], ["wrench_axes"])

    @unittest.skipUnless(polars, "there is no polars")
    def test_a_log_survives_polars(self):
        self.same(polars.DataFrame({name: list(cells) for name, cells in LOG.columns().items()}).fill_nan(None))

    def test_a_header_may_be_a_mapping_with_numbers_of_numpy(self):
        import numpy

        header = {
            "version": 1, "robot": "none", "period_secs": numpy.float64(0.02), "tool_radius_m": 0.02, "gravity_mps2": 9.81,
            "table": {"height_m": 0.0, "friction": {"mean": 0.35, "stddev": 0.05}},
            "object": {"shape": "box", "size_m": numpy.array([0.08, 0.06, 0.05]), "mass_kg": 0.5, "com_m": [0, 0, 0]},
            "split": {"holdout_fraction": 0.3},
        }  # fmt: skip
        log = self.same(LOG.to_pandas(), header)
        self.assertIn("mean = 0.35", log.header)
        header["object"]["mass"] = header["object"].pop("mass_kg")
        with self.assertRaisesRegex(surmise.LogError, "header, key `object.mass`"):
            surmise.Log.from_pandas(LOG.to_pandas(), header)

    def test_a_wrong_cell_is_named_by_row_and_column(self):
        frame = LOG.to_pandas()
        frame.loc[4, "object_x_m"] = float("inf")
        with self.assertRaisesRegex(surmise.LogError, "push, row 5, column `object_x_m`: expected a finite number"):
            surmise.Log.from_pandas(frame, LOG.header, name="push")
        frame["object_x_m"] = "near"
        with self.assertRaisesRegex(surmise.LogError, "column `object_x_m`: expected numbers"):
            surmise.Log.from_pandas(frame, LOG.header)

    def test_a_log_is_written_as_it_was_read(self):
        for kind in ("csv", "parquet"):
            LOG.save(FOLDER / kind, format=kind)
            again = surmise.read_log(FOLDER / kind)
            self.assertEqual({n: bytes(c) for n, c in again.columns().items()}, {n: bytes(c) for n, c in LOG.columns().items()})
            self.assertEqual(again.header, LOG.header)
        with self.assertRaises(surmise.LogError):
            LOG.save(FOLDER / "csv")


class Waiting(unittest.TestCase):
    def test_progress_is_told_in_order(self):
        self.assertTrue(STAGES and all(0 <= done <= limit for _, done, limit in STAGES if limit), STAGES[:3])
        self.assertIn("fitting effects", [stage for stage, _, _ in STAGES])
        self.assertEqual([done for _, done, _ in STAGES], sorted(done for _, done, _ in STAGES))

    def test_control_c_ends_a_diagnosis_soon_and_other_threads_run_meanwhile(self):
        # The timer needs the interpreter while the diagnosis computes.
        log = surmise.read_log(TILT)
        timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
        started = time.monotonic()
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            surmise.diagnose(log, threads=1)
        self.assertLess(time.monotonic() - started, 10.0)

    def test_an_exception_of_who_is_told_ends_it_too(self):
        def stop(stage, done, limit):
            raise RuntimeError(stage)

        with self.assertRaises(RuntimeError):
            surmise.diagnose(surmise.read_log(TILT), threads=1, progress=stop)


class Stubs(unittest.TestCase):
    def test_the_stub_has_what_the_native_module_has(self):
        from surmise import _surmise

        stub = ast.parse(Path(surmise.__file__).with_name("_surmise.pyi").read_text())
        named = {node.name: node for node in stub.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        public = {name for name in dir(_surmise) if not name.startswith("_")}
        self.assertEqual(set(named), public)
        for name, node in named.items():
            methods = {part.name for part in ast.walk(node) if part is not node and isinstance(part, ast.FunctionDef)}
            its = {part for part in dir(getattr(_surmise, name)) if not part.startswith("_")}
            if name not in ("LogError", "diagnose"):
                fields = {part.target.id for part in node.body if isinstance(part, ast.AnnAssign)}
                self.assertEqual(methods | fields, its, name)
        self.assertTrue(Path(surmise.__file__).with_name("py.typed").exists())


class Notebook(unittest.TestCase):
    def test_the_notebook_of_the_book_runs(self):
        """Its cells one after another, as a kernel would; what the last line of one gives can be shown."""
        cells = json.loads(NOTEBOOK.read_text())["cells"]
        code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
        self.assertGreater(len(code), 3)
        names, shown = {}, []
        before = os.getcwd()
        os.chdir(NOTEBOOK.parent)
        try:
            for number, source in enumerate(code):
                tree = ast.parse(source, f"cell {number}")
                last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
                exec(compile(tree, f"cell {number}", "exec"), names)
                if last is not None:
                    value = eval(compile(ast.Expression(last.value), f"cell {number}", "eval"), names)
                    show = getattr(value, "_repr_html_", None)
                    shown.append(show() if show else repr(value))
        finally:
            os.chdir(before)
        self.assertTrue(any("srcdoc" in text for text in shown), "no cell shows the report")


if __name__ == "__main__":
    unittest.main()
