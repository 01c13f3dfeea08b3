"""The command `completion`."""

import click

__all__ = ["completion"]

VARIABLE = "_MOCAPIDX_COMPLETE"


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print what makes SHELL complete commands, options and files.

    \b
    Example:
      echo 'eval "$(mocapidx completion bash)"' >> ~/.bashrc
      echo 'eval "$(mocapidx completion zsh)"' >> ~/.zshrc
      mocapidx completion fish > ~/.config/fish/completions/mocapidx.fish
    """
    from click.shell_completion import BashComplete, FishComplete, ZshComplete

    kinds = {"bash": BashComplete, "zsh": ZshComplete, "fish": FishComplete}
    root = click.get_current_context().find_root()
    complete = kinds[shell](root.command, {}, "mocapidx", VARIABLE)
    click.echo(complete.source_template % complete.source_vars())
