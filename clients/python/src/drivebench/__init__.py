"""A test bench for electric drives: the calls of libdrivebench.

    import drivebench

    with drivebench.Bench("inproc:dc-a-voltage") as bench:
        bench.acquire()
        sample = bench.step(voltages=12.0)

SI units. Motor convention: power into the machine is positive. Rotation is positive from phase a to phase b. Two-phase
quantities are power-invariant (a three-phase amplitude times sqrt(3/2)). Time counts in ticks: step() runs the tick whose
command it brings, except in real time, where it returns with the next one.
"""
from drivebench.aio import AsyncBench
from drivebench.bench import OFF, SHORT, Bench, Command
from drivebench.bridge import Bridge, BridgeEdge, EdgeKind, LegMode
from drivebench.description import Axis, Description, Event, Fault, Injectable, Kind, Mode, Parameter, Signal, State, Type
from drivebench.errors import (BadArgument, BenchClosed, Code, DrivebenchError, Failed, LibraryNotFound, LinkLost, NoBench,
                               OtherAbi, ProgramNotFound, Refused, ServerFailed)
from drivebench.library import Sample, version
from drivebench.recorder import Recorder
from drivebench.recording import Recording, read_recording
from drivebench.server import Server, serve

__all__ = ["OFF", "SHORT", "AsyncBench", "Axis", "BadArgument", "Bench", "BenchClosed", "Bridge", "BridgeEdge", "Code", "Command",
           "Description", "DrivebenchError", "EdgeKind", "Event", "Failed", "Fault", "Injectable", "Kind", "LegMode", "LibraryNotFound", "LinkLost",
           "Mode", "NoBench",
           "OtherAbi", "Parameter", "ProgramNotFound", "Recorder", "Recording", "Refused", "Sample", "Server",
           "ServerFailed", "Signal", "State", "Type", "read_recording", "serve", "version"]
