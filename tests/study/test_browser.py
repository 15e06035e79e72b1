"""A real browser takes the three questionnaires of the thesis, from consent to thanks."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest

from signface.study.questionnaire.store import open_store
from tests.fixtures.study_servers import served
from tests.fixtures.study_site import shipped_study, small_film

pytest.importorskip("starlette", reason="needs the extra study")
webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium (the extra test)")

from selenium.webdriver.support import expected_conditions  # noqa: E402
from selenium.webdriver.support.ui import WebDriverWait  # noqa: E402

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
needs_chromium = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="needs Debian's packages chromium and chromium-driver"
)
#: Set to keep the screenshots.
KEPT = os.environ.get("SIGNFACE_SCREENSHOTS")


@pytest.fixture(scope="module")
def new_browser():
    """Makes browsers, each with a profile of its own."""
    opened = []
    with tempfile.TemporaryDirectory(prefix="signface-chromium-") as profiles:

        def make(telephone=False):
            options = webdriver.ChromeOptions()
            if telephone:
                screen = {"width": 390, "height": 844, "pixelRatio": 2}
                options.add_experimental_option("mobileEmulation", {"deviceMetrics": screen})
            options.binary_location = CHROMIUM
            flags = (
                "headless",
                "no-sandbox",
                "disable-gpu",
                "disable-dev-shm-usage",
                "disable-quic",
                "no-first-run",
                "disable-background-networking",
                "disable-component-update",
                "disable-sync",
                "accept-lang=fr",
                f"user-data-dir={profiles}/{len(opened)}",
                "window-size=1100,900",
            )
            for flag in flags:
                options.add_argument(f"--{flag}")
            options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
            browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
            browser.set_page_load_timeout(60)
            opened.append(browser)
            return browser

        yield make
        for browser in opened:
            browser.quit()


def keep(browser, name: str) -> None:
    """Keep a picture of the whole page, where somebody asked for them."""
    if KEPT:
        Path(KEPT).mkdir(parents=True, exist_ok=True)
        size = browser.get_window_size()
        height = browser.execute_script("return document.documentElement.scrollHeight")
        browser.set_window_size(size["width"], max(size["height"], height + 150))
        browser.save_screenshot(str(Path(KEPT) / f"{name}.png"))
        browser.set_window_size(size["width"], size["height"])


def path_of(browser) -> str:
    return "/" + browser.current_url.split("/", 3)[3]


def press_on(browser) -> None:
    """Press the page's button and wait for the next page."""
    before = browser.find_element("css selector", "html")
    browser.find_element("css selector", "button[type=submit]").click()
    WebDriverWait(browser, 30).until(expected_conditions.staleness_of(before))


def answer_page(browser) -> None:
    """Choose an answer to every question by clicking, and press the button."""
    browser.execute_script(
        "for (const field of document.querySelectorAll('fieldset')) field.querySelectorAll('label')[1].click();"
        "for (const box of document.querySelectorAll('input[type=checkbox]')) box.click();"
        "for (const text of document.querySelectorAll('input[type=text]')) text.value = '33';"
    )
    press_on(browser)


def go_through(browser, until: int | None = None) -> int:
    """Answer pages until the thanks, or `until` films."""
    films = 0
    while path_of(browser) != "/thanks" and (until is None or films < until):
        films += bool(browser.find_elements("css selector", "video"))
        answer_page(browser)
    return films


def wrong_in_console(browser) -> list[str]:
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize(("name", "films"), [("group-1", 18), ("group-2a", 18), ("group-2b", 12)])
def test_a_browser_takes_a_questionnaire_of_the_thesis(new_browser, tmp_path, name, films):
    study = shipped_study(name, tmp_path, small_film(), intensities="[2]")
    browser = new_browser()
    with served(tmp_path) as (address, _):
        browser.get(address)
        assert browser.find_element("css selector", "html").get_attribute("lang") == "fr"
        keep(browser, f"{name}-consent")
        answer_page(browser)
        keep(browser, f"{name}-personal")
        answer_page(browser)
        keep(browser, f"{name}-film")
        plays = "const v = document.querySelectorAll('video'); return [...v].map(x => [x.readyState, x.error]);"
        wait = WebDriverWait(browser, 20)
        wait.until(lambda b: all(state >= 2 and error is None for state, error in b.execute_script(plays)))
        assert len(browser.execute_script(plays)) == (2 if name == "group-2b" else 1)
        browser.find_element("css selector", "button.play").click()
        wait.until(
            lambda b: b.execute_script("return [...document.querySelectorAll('video')].every(v => v.played.length)")
        )
        assert go_through(browser) == films
        keep(browser, f"{name}-thanks")
        assert wrong_in_console(browser) == []
    store = open_store(tmp_path / "answers.sqlite")
    people, answers = store.everything()
    store.close()
    assert [person.finished for person in people] == [True]
    asked = sum(len(block.stimuli) * len(block.questions) for block in study.blocks)
    assert len(answers) == len(study.personal) + asked


@pytest.mark.slow
@needs_chromium
def test_a_browser_resumes_in_the_middle_on_a_telephone(new_browser, tmp_path):
    shipped_study("group-2a", tmp_path, small_film(), intensities="[2]")
    first = new_browser()
    with served(tmp_path) as (address, _):
        first.get(address)
        go_through(first, until=5)
        place = path_of(first)
        first.execute_script("document.querySelector('details.later').open = true")
        link = first.find_element("css selector", "a.private").text
        assert link.startswith(address)
        keep(first, "resume-link")
        second = new_browser(telephone=True)
        second.get(link)
        assert path_of(second) == place
        keep(second, "telephone-film")
        wide = "return document.documentElement.scrollWidth <= document.documentElement.clientWidth"
        assert second.execute_script(wide), "the page is wider than a telephone"
        small = (
            "return [...document.querySelectorAll('main label:has(input), main button:not([hidden]), main a.button')]"
            ".map(e => [e.textContent.trim(), e.getBoundingClientRect().width, e.getBoundingClientRect().height])"
            ".filter(([, w, h]) => w < 24 || h < 44)"
        )
        assert second.execute_script(small) == []
        assert go_through(second) == 18 - 5
        token = (tmp_path / "organiser-token").read_text().strip()
        first.get(f"{address}/organiser/{token}")
        keep(first, "organiser")
        assert "100 %" in first.find_element("css selector", "main").text


@pytest.mark.slow
@needs_chromium
def test_a_page_is_answered_with_the_keyboard_alone(new_browser, tmp_path):
    from selenium.webdriver.common.keys import Keys

    shipped_study("group-2b", tmp_path, small_film(), intensities="[2]")
    browser = new_browser()
    with served(tmp_path) as (address, _):
        browser.get(address)
        answer_page(browser)
        answer_page(browser)
        place = path_of(browser)
        reached = []
        for _ in range(40):
            browser.switch_to.active_element.send_keys(Keys.TAB)
            active = browser.switch_to.active_element
            reached.append((active.tag_name, active.get_attribute("name") or active.get_attribute("type") or ""))
            if active.get_attribute("name") == "answer_fidelity":
                active.send_keys(Keys.ARROW_RIGHT)  # from the first, which is not chosen yet, to the second
                browser.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
            if active.tag_name == "button" and active.get_attribute("type") == "submit":
                keep(browser, "keyboard")
                active.send_keys(Keys.ENTER)
                break
        WebDriverWait(browser, 20).until(lambda b: path_of(b) != place)
        assert ("input", "answer_fidelity") in reached
    store = open_store(tmp_path / "answers.sqlite")
    assert [answer[3] for answer in store.everything()[1] if answer[2] == "answer_fidelity"] == ["3"]
    store.close()


@pytest.mark.slow
@needs_chromium
def test_a_page_that_is_sent_unanswered_says_what_is_missing(new_browser, tmp_path):
    shipped_study("group-1", tmp_path, small_film(), intensities="[2]")
    browser = new_browser()
    with served(tmp_path) as (address, _):
        browser.get(address)
        answer_page(browser)
        answer_page(browser)
        browser.execute_script("document.querySelector('main form').noValidate = true")
        press_on(browser)
        keep(browser, "mistakes")
        assert browser.switch_to.active_element.get_attribute("id") == "mistakes"
        links = browser.find_elements("css selector", "#mistakes a")
        assert len(links) == 4
        links[2].click()
        assert browser.execute_script("return document.querySelector(':target').name") == "answer_difficulty"
