"""Compiled loops: kept on disk, and running all the same where nothing can be kept."""

import numba
import pytest
from numba.core.dispatcher import Dispatcher

from signface import compiling
from signface.compiling import compiled, on_compiling
from signface.render import loops as render_loops
from signface.solver import loops as solver_loops
from signface.takes import biquad


def doubled(value):
    return 2.0 * value


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
@pytest.mark.parametrize("module", [render_loops, solver_loops, biquad])
def test_every_loop_is_kept_on_disk(module):
    dispatchers = [value for value in vars(module).values() if isinstance(value, Dispatcher)]
    assert dispatchers
    for dispatcher in dispatchers:
        assert dispatcher.stats.cache_path or dispatcher.py_func.__name__ in compiling._unkept


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
def test_a_loop_runs_where_no_folder_can_keep_it_and_says_so(monkeypatch):
    def refused(self):
        raise RuntimeError("no locator available")

    monkeypatch.setattr(Dispatcher, "enable_caching", refused)
    monkeypatch.setattr(compiling, "_unkept", [])
    loop = compiled()(doubled)
    heard: list[bool] = []
    on_compiling(heard.append)
    assert loop(1.5) == 3.0
    assert heard == [False]
