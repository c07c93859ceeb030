"""From an error to an exit code: one readable message on standard error, and a log file for a bug of our own."""

import errno
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import click

from results_schema.errors import BadInput, Interrupted, OutputFailed, WanderlastError, WorkersGaveUp

_OUTPUT_ERRORS = {errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.EFBIG}


def exit_code_of(command: Callable[[], int]) -> int:
    """Run a command; its own exit code, or that of the error that it raised."""
    try:
        code = command()
        if sys.stdout is not None:
            sys.stdout.flush()
    except (BrokenPipeError, SystemExit):
        # The reader (`| head`) has seen enough. click turns that into SystemExit, which nothing else raises.
        drop_stdout()
        return 0
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.UsageError as error:
        _complain_about_usage(error)
        return BadInput.exit_code
    except (KeyboardInterrupt, click.Abort):
        _complain("interrupted")
        return Interrupted.exit_code
    except WanderlastError as error:
        _complain(str(error))
        return error.exit_code
    except Exception as error:
        return _code_of_unforeseen(error)
    return code


def drop_stdout() -> None:
    """Send whatever is still to be printed nowhere: nobody reads it."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def _code_of_unforeseen(error: Exception) -> int:
    if isinstance(error, MemoryError):
        remedy = "remedy: fewer --threads, fewer variants, or more memory; finished work is kept"
        _complain(f"not enough memory ({_words(error) or 'none is left'}); {remedy}")
        return WorkersGaveUp.exit_code
    if isinstance(error, OSError) and error.errno in _OUTPUT_ERRORS:
        drop_stdout()
        _complain(f"output failed: {error}")
        return OutputFailed.exit_code
    _complain(f"a bug of our own ({type(error).__name__}: {_words(error)}); details in {_log(error)}")
    return WanderlastError.exit_code


def _words(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def _complain_about_usage(error: click.UsageError) -> None:
    from engine.scene.settings import setting_named

    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        with suppress(OSError):
            error.show()
        return
    _complain(error.format_message())
    if isinstance(error, click.NoSuchOption) and (key := setting_named(error.option_name.lstrip("-"))):
        table, name = key.split(".")
        click.echo(f"the study file says that: {name} = ... below [{table}]", err=True)
    if error.ctx is not None:
        click.echo(f'try "{error.ctx.command_path} --help"', err=True)


def _complain(message: str) -> None:
    with suppress(OSError):
        click.echo(f"wanderlast: {message}", err=True)


def _log(error: Exception) -> str:
    """Write the traceback into a new file of the working folder, or else of the temporary one; its path."""
    name = f"wanderlast-{datetime.now():%Y%m%d-%H%M%S}-{os.getpid()}.log"
    text = "".join([f"wanderlast {' '.join(sys.argv[1:])}\n", *traceback.format_exception(error)])
    for folder in (Path.cwd(), Path(tempfile.gettempdir())):
        with suppress(OSError), (folder / name).open("x", encoding="utf-8") as stream:
            stream.write(text)
            return str(folder / name)
    click.echo(text, err=True)
    return "the lines above"
