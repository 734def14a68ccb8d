"""Signals of a run and of a recording as NumPy arrays and pandas DataFrames. Skipped where these are not installed."""
import pathlib
import sys
import tempfile
import unittest

try:
    import numpy
    import pandas
except ImportError as missing:
    print(f"SKIPPED: {missing.name} is not installed")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "helpers"))
import python_package  # noqa: E402, F401

import drivebench  # noqa: E402


class Arrays(unittest.TestCase):
    # Catches: integers that lose their last bits in a float, columns under each other's names, a time that is off by a tick.
    def test_a_record_is_arrays_and_a_frame(self):
        with drivebench.Bench("inproc:dc-a-voltage") as bench, bench.record(["speed_rad_s", "index_tick", "faults"]) as run:
            bench.acquire()
            last = bench.run(lambda sample: drivebench.Command(voltages=numpy.float32(12.0)), 100)
        arrays = run.arrays()
        self.assertEqual({name: str(array.dtype) for name, array in arrays.items()},
                         {"tick": "uint64", "speed_rad_s": "float64", "index_tick": "int64", "faults": "uint64"})
        self.assertEqual(arrays["speed_rad_s"][-1], last.speed_rad_s)
        self.assertEqual(arrays["index_tick"][0], -1)
        frame = run.dataframe()
        self.assertIsInstance(frame, pandas.DataFrame)
        self.assertEqual(frame.index.name, "time_s")
        self.assertEqual((frame.index[0], frame.index[100]), (0.0, 100 * 1e-4))
        self.assertTrue((numpy.diff(frame["tick"]) == 1).all())

    # Catches: set-points that are taken as one number because they are no list.
    def test_set_points_may_be_arrays(self):
        with drivebench.Bench("inproc:servo") as bench:
            bench.acquire()
            sample = bench.step(voltages=numpy.array([3.0, -2.0]))
            self.assertEqual((sample.u_a_v, sample.u_b_v), (3.0, -2.0))
            with self.assertRaisesRegex(drivebench.BadArgument, "needs 2"):
                bench.step(voltages=numpy.zeros(3))

    # Catches: columns that are read under each other's names, digits that get lost on the way, a cut recording that looks whole.
    def test_a_recording_has_what_the_program_saw(self):
        signals = ["encoder_count", "i_b_a", "speed_rad_s"]
        with tempfile.TemporaryDirectory() as folder:
            for end in ("stop", "kill"):
                file = pathlib.Path(folder) / f"{end}.mcap"
                with drivebench.serve("servo", "--record", str(file)) as server, drivebench.Bench(server.address) as bench:
                    bench.acquire()
                    with bench.record(signals) as run:
                        bench.run(lambda sample: drivebench.Command(voltages=(30.0, sample.tick * 0.01)), 300)
                    bench.release()
                    server.process.kill() if end == "kill" else server.stop()
                    server.process.wait()
                recording = drivebench.read_recording(file, signals)
                self.assertEqual(recording.whole, end == "stop")
                for name in recording.names:  # of a killed server perhaps nothing was written
                    numpy.testing.assert_array_equal(recording[name][:301], run[name][:len(recording)])
                if recording.whole:
                    self.assertEqual(recording.names, ["tick", *signals])
                    self.assertGreaterEqual(len(recording), 301)
                    numpy.testing.assert_allclose(recording.dataframe().index[:301], run.dataframe().index, atol=1e-9)
                    self.assertIn("torque_nm", drivebench.read_recording(file).names)

    # Catches: a recording that cannot be read and yet gives an empty table.
    def test_what_is_no_recording_is_an_exception(self):
        with self.assertRaisesRegex(drivebench.BadArgument, "No such file"):
            drivebench.read_recording("--help")
        with self.assertRaisesRegex(drivebench.BadArgument, "cannot be read"):
            drivebench.read_recording(__file__)
        with self.assertRaisesRegex(drivebench.BadArgument, "signals is 3"):
            drivebench.read_recording(__file__, [3])


if __name__ == "__main__":
    unittest.main(verbosity=2)
