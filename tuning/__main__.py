"""`python -m tuning`, `absjax-tuning`."""


def main() -> None:
    """Run the command line; say what to install where something of it is missing."""
    try:
        from tuning.cli import app
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in ("absjax", "tuning", "jax", "numpy"):
            raise
        raise SystemExit(f"the command line needs {error.name}: pip install 'absjax[tuning]'") from None
    app(prog_name="python -m tuning")


if __name__ == "__main__":
    main()
