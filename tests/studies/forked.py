"""The command in forked processes of this one, which has loaded and compiled everything that they need."""

import os

from studies.commands.cli import main


def forked(*arguments: str, screen: str = os.devnull) -> int:
    """The number of a process that runs the command; what it says goes to the file `screen`."""
    number = os.fork()
    if number == 0:
        written = os.open(screen, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(written, 1)
        os.dup2(written, 2)
        os._exit(main(arguments))
    return number


def exit_code(number: int) -> int:
    """What a process ends with; of a signal, its number as a negative one."""
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
