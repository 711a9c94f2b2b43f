"""Nothing in a config or a study is evaluated, imported or unpickled: the interpreter itself is asked.

Python tells an audit hook of everything it compiles, executes, imports and unpickles, of processes, sockets and files
that are opened. A benign command tells what happens anyway; a hostile one of the same kind may add nothing to it.
"""

import pickle

import pytest
from hostile_judging import DONE, REFUSED, judge, sizes

CODE = "__import__('os').system('touch pwned')"
WORDS = (
    CODE, "os.system", "builtins.eval", "evil.pkl", "evil", "evil:run", "./evil.py",
    "!!python/object/apply:os.system ['touch pwned']",
    "{{ 7 * 7 }}", "${jndi:ldap://localhost/a}", "$(touch pwned)", "`touch pwned`", "; touch pwned", "file:///etc/passwd",
    "http://localhost:1/a", "solvers.backends.native", "deli.scenes.point_mass", "%(os)s", "{0.__class__}",
)  # fmt: skip
KEYS = (
    "scene.name", "scene.mass", "scene.start", "scene.position", "scene.perturbation", "scene", "method.name",
    "method.scheme",
    "method", "solvers.default.backend", "solvers.default.options", "solvers.default.options.linear_solver", "solvers",
    "record.output", "record.subproblems", "step_size", "skip",
)  # fmt: skip
BACKENDS = ("{}", "cvxpy:{}", "native:{}", "auto,{}", "cvxpy:CLARABEL;{}", "deli.solvers:{}")


class Evil:
    """Unpickled, it runs a command."""

    def __reduce__(self):
        return exec, ("open('pwned', 'w')",)


@pytest.fixture
def place(tmp_path):
    """A folder full of what must not be run, with all the names that are tried."""
    (tmp_path / "evil.py").write_text("open('pwned', 'w')\n")
    (tmp_path / "evil.pkl").write_bytes(pickle.dumps(Evil()))
    (tmp_path / "point_mass.py").write_text("open('pwned', 'w')\n")
    (tmp_path / "sitecustomize.py").write_text("open('pwned', 'w')\n")
    yield tmp_path
    assert not (tmp_path / "pwned").exists()


def happened(victim, place, *command):
    """Run a command; return what became of it, and what Python told of it."""
    outcome = judge(victim.run(place, *command, watched=True), *KEYS, *command)
    return outcome, {f"{event} {what}" for event, what in outcome.events}


def usually(victim, place, *commands):
    """What Python tells of commands that mean no harm, once all they need is imported and compiled."""
    for command in commands:
        happened(victim, place, *command)
    return set().union(*(happened(victim, place, *command)[1] for command in commands))


def quoted(word):
    return '"' + word.replace("\\", "\\\\").replace('"', '\\"') + '"'


def test_the_watch_sees_what_it_is_for(victim, place):
    """Without this the others could not fail."""
    (place / "config.toml").write_text('scene = "point_mass"\nsteps = 2\n')
    for act in ("eval", "exec", "import", "import_module", "unpickle", "system", "popen", "write", "connect"):
        assert victim.run(place, "--act", act, watched=True).events, act
    (place / "pwned").unlink(missing_ok=True)


@sizes(3, len(WORDS))
def test_configs(victim, place, examples):
    benign = ("run", "point_mass", "--set", "steps=2", "-q", "--overwrite", "-o", "run.nc")
    wrong = ("scene.x=1", "solvers.default.options.x=1", "solvers=cvxpy:CLARABEL", "solvers=cvxpy:none", "scene.mass=0")
    usual = usually(victim, place, benign, *((*benign, "--set", setting) for setting in wrong))
    refused = 0
    words = WORDS[:examples]
    for key in KEYS:
        for word in words:
            outcome, seen = happened(victim, place, *benign, "--set", f"{key}={quoted(word)}")
            assert seen <= usual, (key, word, seen - usual)
            refused += outcome.status == REFUSED
    assert refused > 0.8 * len(KEYS) * examples
    for form in BACKENDS:
        for word in words:
            outcome, seen = happened(victim, place, *benign, "--set", f"solvers={quoted(form.format(word))}")
            assert seen <= usual, (form, word, seen - usual)
            assert outcome.status == REFUSED


def test_options_of_solvers(victim, place):
    """Values go to a solver as they are; names of files are refused."""
    benign = ("run", "newtons_cradle", "--set", "steps=2", "--set", "skip=false", "-q", "--overwrite", "-o", "run.nc")
    for backend, option in (
        ("osqp", "max_iter"),
        ("clarabel", "max_iter"),
        ("scs", "max_iters"),
        ("highs", "presolve"),
    ):
        choice = ("--set", f"solvers={backend}")
        if happened(victim, place, *benign, *choice)[0].status != DONE:
            continue  # it is not installed
        usual = usually(victim, place, (*benign, *choice), (*benign, *choice, "--set", "solvers.default.options.x=1"))
        for name, value in (
            (option, CODE),
            (option, "evil.pkl"),
            ("__class__", CODE),
            ("solver", "evil"),
            ("log_file", "pwned"),
        ):
            override = f"solvers.default.options={{ {name} = {quoted(value)} }}"
            outcome, seen = happened(victim, place, *benign, *choice, "--set", override)
            assert outcome.status == REFUSED, (backend, name, value)
            assert seen <= usual, (backend, name, seen - usual)
    for name in ("log_file", "solution_file", "write_model_file", "write_data_filename", "log_csv_filename", "LogFile"):
        override = f"solvers.default={{ backend = 'highs', options = {{ {name} = 'pwned' }} }}"
        outcome, _ = happened(victim, place, *benign, "--set", override)
        assert f"{name} names a file" in outcome.errors


@pytest.mark.parametrize("file", ["evil.py", "evil.pkl", "sitecustomize.py"])
def test_files_of_code(victim, place, file):
    (place / "study.toml").write_text(f'base = "{file}"\naxes.step_size = [0.1]\n')
    (place / "none.toml").write_text("a = = 1")
    commands = (("run", "none.toml"), ("check", "none.toml"), ("study", "none.toml"), ("study", "study.toml"))
    usual = usually(victim, place, *commands)
    (place / "none.toml").write_bytes((place / file).read_bytes())
    for command in (
        ("run", file),
        ("run", "none.toml"),
        ("check", "none.toml"),
        ("study", file),
        ("study", "study.toml"),
    ):
        outcome, seen = happened(victim, place, *command)
        assert outcome.status == REFUSED
        assert seen <= usual, (command, seen - usual)
    for command in (("check", file), ("plot", file), ("report", "."), ("animate", file), ("replay", file)):
        happened(victim, place, *command)


def test_studies(victim, place):
    """Planning a study, which is all that happens in this process; its workers read configs that deli wrote."""

    def text(word):
        return (
            f'title = {word}\n[base]\nscene = "point_mass"\nsteps = 2\n'
            f"[axes]\nstep_size = [{{ label = {word}, value = 0.1 }}, 0.2]\n"
            f"[[cases]]\nlabel = {word}\nrecord.output = {word}\n"
            f'[[plots]]\nkind = "energy_traces"\ntitle = {word}\nby = "step_size"\n'
        )

    command = ("study", "study.toml", "--dry-run")
    (place / "study.toml").write_text(text('"benign"'))
    usual = usually(victim, place, command)
    for word in WORDS:
        (place / "study.toml").write_text(text(quoted(word)))
        outcome, seen = happened(victim, place, *command)
        assert outcome.status == DONE
        assert seen <= usual, (word, seen - usual)
