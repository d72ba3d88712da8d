# SPDX-License-Identifier: GPL-3.0-or-later
"""Lanes as Ray actors: on this machine's cores, or on those of a cluster."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import socket
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from generator.cgroup import worthwhile
from generator.errors import DatasetError, UsageError
from generator.execution.executors.executor import Circumstances
from generator.execution.executors.order_queue import OrderQueue
from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions, OnImage
from generator.execution.lanes.scratch import remove_leftovers, scratch_folder
from generator.execution.lanes.slot import ATTEMPTS, LaneSlot, Outcome
from generator.interpreter import guard_environment
from generator.messages import BuildOrder, LaneOrder, from_json, to_json
from generator.process import available_cores
from generator.reading import parse_json
from litert_faces.installing import install_command

_HOME = Path(__file__).resolve().parents[3]

IN_FLIGHT = 2
"""Orders an actor has at a time: one to work on, one that waits at its door."""

OBJECT_STORE_BYTES = 100 * 2**20
"""Receipts are all that ever lies there."""

ANSWER_S = 10.0
"""How long a cluster may take to accept a connection."""

CLOSING_S = 10.0
"""How long an idle actor may take to clean up."""


class LaneActor:
    """A lane in a process of Ray's. Orders and receipts are JSON texts; images never leave it.

    A render worker that breaks is replaced here, as in the other executors; what
    breaks the actor itself is Ray's to restart.
    """

    def __init__(self, options: str) -> None:
        values = parse_json(options)
        self._stack = ExitStack()
        scratch = self._stack.enter_context(scratch_folder())
        core = self._stack.enter_context(_own_core())
        own = LaneOptions(**{**values, "scratch": str(scratch), "cpus": (), "threads": 1})
        if core is not None:
            os.sched_setaffinity(0, {core})  # inherited by the render worker
        if own.gpu is not None:
            own = replace(own, gpu=core or 0)
        self._slot = LaneSlot(lambda: Lane(own))

    def run(self, order: str) -> str:
        """Carry out one order. Returns {"receipt", "error", "attempts", "log"} or {"fatal"}."""
        try:
            outcome = self._slot.run(from_json(parse_json(order)), lambda: None)
        except DatasetError as error:
            return json.dumps({"fatal": str(error)})
        values = {key: value for key, value in vars(outcome).items() if key not in ("order", "receipt")}
        receipt = None if outcome.receipt is None else to_json(outcome.receipt)
        return json.dumps({**values, "receipt": receipt})

    def close(self) -> None:
        """End the render worker and remove the scratch folder."""
        self._slot.close()
        self._stack.close()


class RayExecutor:
    """See :class:`generator.execution.executors.executor.Executor`.

    Actors are as many as workers are asked for; by default every core of the cluster, or of this
    machine. An address names a running cluster, or is "auto"; None starts Ray here, on loopback only.

    Raises UsageError if Ray is not installed or no cluster answers.
    """

    name = "ray"

    def __init__(self, circumstances: Circumstances) -> None:
        with _environment_of_its_own():
            self._join(circumstances.workers, circumstances.address)
        remote: Any = self._ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=ATTEMPTS - 1)(LaneActor)
        given = json.dumps(asdict(circumstances.options))
        self._actors = [remote.remote(given) for _ in range(self.workers)]
        self._busy = False

    def _join(self, workers: int | None, address: str | None) -> None:
        """Start a Ray or join the one at the address."""
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        if address is None:
            # Read when ray is imported: a Ray that cannot be joined listens on 127.0.0.1 alone.
            os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
        try:
            import ray
        except ImportError as error:
            raise UsageError(f"Ray is not installed: {install_command('cluster')}") from error
        self._ray = ray
        if address is None:
            self.workers = workers or worthwhile(available_cores())
            with _at_home():
                ray.init(
                    num_cpus=self.workers,
                    object_store_memory=OBJECT_STORE_BYTES,
                    include_dashboard=False,
                    log_to_driver=False,
                    logging_level=logging.ERROR,
                )
            if ray.util.get_node_ip_address() != "127.0.0.1":
                ray.shutdown()
                raise UsageError(
                    "Ray would listen on the network: this process imported it before; "
                    "open the executor first, or start a cluster and give its --address"
                )
        else:
            try:
                _answers(address)
                with _at_home():
                    ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
            except (OSError, ValueError, RuntimeError) as error:
                raise UsageError(f"--address {address}: no Ray cluster answers ({error})") from error
            self.workers = workers or int(ray.cluster_resources().get("CPU", 1))

    def run(self, orders: Sequence[LaneOrder], on_image: OnImage) -> Iterator[Outcome]:
        """See the Executor protocol; frames are told of when their unit is done."""
        waiting = OrderQueue(orders)
        held: list[str | None] = [None] * len(self._actors)
        in_flight: dict[Any, tuple[int, LaneOrder]] = {}

        def feed(number: int) -> None:
            taken = waiting.take(held[number])
            if taken is not None:
                held[number], order = taken
                in_flight[self._actors[number].run.remote(json.dumps(to_json(order)))] = number, order

        self._busy = True
        for _ in range(IN_FLIGHT):
            for number in range(len(self._actors)):
                feed(number)
        while in_flight:
            [ready], _ = self._ray.wait(list(in_flight), num_returns=1)
            number, order = in_flight.pop(ready)
            outcome = self._outcome(ready, order)
            feed(number)
            if outcome.receipt is not None and isinstance(order, BuildOrder):
                for _ in order.views:
                    on_image()
            yield outcome
        self._busy = False

    def close(self) -> None:
        """End every actor; at once those that are in the middle of an order."""
        if not self._busy:
            with contextlib.suppress(self._ray.exceptions.RayError):
                self._ray.get([actor.close.remote() for actor in self._actors], timeout=CLOSING_S)
        for actor in self._actors:
            self._ray.kill(actor)
        self._ray.shutdown()
        remove_leftovers()

    def _outcome(self, ready: Any, order: LaneOrder) -> Outcome:
        try:
            values = parse_json(self._ray.get(ready))
        except self._ray.exceptions.RayError as error:
            # Not the unit's own failure, which comes as a value: the actor died, again and again.
            told = str(error).strip()
            reason = f"its Ray actor was lost: {told.splitlines()[0]}"
            return Outcome(order, None, reason, ATTEMPTS, told)
        if "fatal" in values:
            raise DatasetError(values["fatal"])
        receipt = values.pop("receipt")
        return Outcome(order, None if receipt is None else from_json(receipt), **values)


def _answers(address: str) -> None:
    """Raises OSError unless something listens at host:port: Ray itself would wait for minutes."""
    host, colon, port = address.rpartition(":")
    if colon and port.isdigit():
        socket.create_connection((host.removeprefix("ray://"), int(port)), ANSWER_S).close()


@contextlib.contextmanager
def _environment_of_its_own() -> Iterator[None]:
    """What Ray starts takes no module from a current folder; a program that calls this keeps its own."""
    before = os.environ.copy()
    guard_environment()
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextlib.contextmanager
def _at_home() -> Iterator[None]:
    """Ray has its workers look for modules where its driver is at this moment: where ours come from."""
    before = Path.cwd()
    os.chdir(_HOME)
    try:
        yield
    finally:
        os.chdir(before)


@contextlib.contextmanager
def _own_core() -> Iterator[int | None]:
    """A core no other lane of this machine has claimed; None if all are taken, or off Linux.

    The claim is a name in Linux's abstract socket space: no file, no network, and
    gone with the process.
    """
    with ExitStack() as stack:
        core = None
        if hasattr(os, "sched_setaffinity") and hasattr(socket, "AF_UNIX"):
            for candidate in available_cores():
                claim = socket.socket(socket.AF_UNIX)
                try:
                    claim.bind(f"\0headturn-core-{candidate}")
                except OSError:
                    claim.close()
                    continue
                stack.enter_context(claim)
                core = candidate
                break
        yield core
