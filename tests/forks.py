"""The program as a process that is forked from one which has loaded it: most of a short run is the interpreter's start.

    python forks.py serve SOCKET        load the program, and fork it for each call
    python -IS forks.py call SOCKET ... ask for a call, with this process's streams, folder, variables and limits

A fork is a process as any other, with descriptors, signals and an end of its own. What an interpreter reads at its
start is that of the server: a call with one of those variables, and tests of what is imported, of closed streams or of
descriptors beyond the first three, start an interpreter.
FORK_FIRST is Python that runs before the program does.
"""

import json
import os
import resource
import signal
import socket
import sys
from contextlib import suppress

LIMITS = (resource.RLIMIT_AS, resource.RLIMIT_CPU, resource.RLIMIT_FSIZE)
FORWARDED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FIRST = "FORK_FIRST"
READ_AT_START = {"PYTHONHASHSEED", "PYTHONIOENCODING", "PYTHONUNBUFFERED"}


def call(path: str, arguments: list[str]) -> int:
    """Run the program with these arguments; gives its exit code, or ends as it did."""
    if READ_AT_START & os.environ.keys():
        os.execv(sys.executable, [sys.executable, "-m", "busplan", *arguments])
    with socket.socket(socket.AF_UNIX) as server:
        server.connect(path)
        limits = [resource.getrlimit(limit) for limit in LIMITS]
        asked = json.dumps([arguments, dict(os.environ), limits]).encode()
        socket.send_fds(server, [len(asked).to_bytes(4, "big")], [0, 1, 2, os.open(".", os.O_RDONLY)])
        server.sendall(asked)
        pid = int.from_bytes(server.recv(4), "big")
        for number in FORWARDED:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, lambda number, _: os.kill(pid, number))
        status = int.from_bytes(server.recv(4), "big")
    if os.WIFSIGNALED(status):
        with suppress(OSError):  # nobody handles SIGKILL
            signal.signal(os.WTERMSIG(status), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(status))
    return os.waitstatus_to_exitcode(status)


def serve(path: str) -> None:
    """Fork the program for each call until standard input ends."""
    from io import BytesIO, TextIOWrapper  # noqa: PLC0415 - a call pays for nothing
    from select import select  # noqa: PLC0415

    from busplan.__main__ import main  # noqa: PLC0415

    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
    listener.listen()
    for line in ("capacity paper-4ms --format json", "check paper-4ms", "diff paper-4ms paper-1ms"):
        sys.argv, sys.stdout = ["busplan", *line.split()], TextIOWrapper(BytesIO())
        with suppress(SystemExit):
            main()
    os.write(1, b"ready\n")
    while 0 not in select([listener.fileno(), 0], [], [])[0]:
        with suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        client, _ = listener.accept()
        if not os.fork():
            listener.close()
            if start(client):
                main()
            return
        client.close()


def start(client: socket.socket) -> bool:
    """Fork once more: true in the process that is to be the program; the other one waits for it and tells its end."""
    head, descriptors, *_ = socket.recv_fds(client, 4, 4)
    asked = b""
    while len(asked) < int.from_bytes(head, "big"):
        asked += client.recv(1 << 20)
    if pid := os.fork():
        for descriptor in descriptors:
            os.close(descriptor)
        watch(client, pid)
        os._exit(0)
    client.close()
    arguments, variables, limits = json.loads(asked)
    os.fchdir(descriptors[3])
    for number, descriptor in enumerate(descriptors[:3]):
        os.dup2(descriptor, number)
    for descriptor in descriptors:
        os.close(descriptor)
    sys.stdin = sys.__stdin__ = open(0, encoding="utf-8", closefd=False)  # type: ignore[misc]  # noqa: SIM115
    sys.stdout = sys.__stdout__ = open(1, "w", encoding="utf-8", closefd=False)  # type: ignore[misc]  # noqa: SIM115
    sys.stderr = sys.__stderr__ = open(  # type: ignore[misc]  # noqa: SIM115
        2, "w", encoding="utf-8", errors="backslashreplace", buffering=1, closefd=False
    )
    for number in FORWARDED:
        signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for limit, pair in zip(LIMITS, limits, strict=True):
        resource.setrlimit(limit, pair)
    os.environ.clear()
    os.environ.update(variables)
    sys.argv = ["busplan", *arguments]
    exec(os.environ.pop(FIRST, ""), {})
    return True


def watch(client: socket.socket, pid: int) -> None:
    """Tell a client of its process: the number and, when it has ended, how; whoever goes away kills it."""
    from select import select  # noqa: PLC0415

    client.sendall(pid.to_bytes(4, "big"))
    ended = os.pidfd_open(pid)
    if ended not in select([ended, client.fileno()], [], [])[0]:
        os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    with suppress(OSError):
        client.sendall(status.to_bytes(4, "big"))


if __name__ == "__main__":
    action, where, *words = sys.argv[1:]
    if action == "call":
        sys.exit(call(where, words))
    serve(where)
