"""Markdown for a terminal."""

import io

from rich.console import Console, ConsoleOptions, RenderResult
from rich.markdown import CodeBlock, Markdown, MarkdownContext, TableDataElement
from rich.syntax import Syntax
from rich.text import TextType
from rich.theme import Theme

_STYLES = Theme({"markdown.code": "bold cyan"})  # On the terminal's own ground, light or dark.


class _Cell(TableDataElement):
    """A cell of a table that folds long words, where rich cuts them off."""

    def on_text(self, context: MarkdownContext, text: TextType) -> None:
        super().on_text(context, text)
        self.content.overflow = "fold"


class _Code(CodeBlock):
    """Code from the first column to the last, where rich leaves one free: a card takes 80."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        code = str(self.text).rstrip()
        yield Syntax(code, self.lexer_name, theme=self.theme, word_wrap=True, padding=(1, 0))


class _Page(Markdown):
    elements = {**Markdown.elements, "td_open": _Cell, "th_open": _Cell, "fence": _Code}  # noqa: RUF012 - as in rich


def rendered(markdown: str) -> str:
    """Markdown for a terminal, at its width and in its colours; NO_COLOR is honoured."""
    buffer = io.StringIO()
    console = Console(file=buffer, force_terminal=True, theme=_STYLES)
    console.print(_Page(markdown, code_theme="ansi_dark", hyperlinks=False))
    return buffer.getvalue()
