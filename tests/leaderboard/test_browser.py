"""The site in a real browser, from the file system, as a reader without a network has it."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select
from small_cells import secant
from small_submissions import submitted

from granbench.data.replicates import replicate_scatter
from granbench.leaderboard.board import Row
from granbench.leaderboard.build import build
from granbench.leaderboard.submission import read_submission

pytestmark = pytest.mark.browser

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[webdriver.Chrome]:
    if not (CHROMIUM and DRIVER):
        pytest.fail("chromium and chromedriver are missing: run `make browser`")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (
        "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        "--window-size=1280,1000", f"--user-data-dir={tmp_path_factory.mktemp('profile')}",
    ):  # fmt: skip
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def index(_submissions, sealed, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("browsed")
    files = [_submissions / f"{name}.json" for name in ("secant", "oracle", "persistence")]
    partial = folder / "partial.json"
    files.append(submitted(secant("partial"), sealed, partial, axes=["single-step", "rollout"]))
    rows = [Row(read_submission(file), file) for file in files]
    scatter = {("synthetic", "1.0.0"): replicate_scatter(sealed)}
    return build(rows, folder / "site", scatter)


@pytest.fixture
def page(browser, index) -> Path:
    browser.get(index.as_uri())
    browser.find_element(By.LINK_TEXT, "synthetic").click()
    return index.parent


def visible_table(browser):
    tables = browser.find_elements(By.CSS_SELECTOR, "section[data-metric] table")
    (table,) = [table for table in tables if table.is_displayed()]
    return table


def column(table, index: int) -> list[float | None]:
    """The sorting values of a column, from the top; None for an absent one."""
    cells = table.find_elements(By.CSS_SELECTOR, f"tbody tr > :nth-child({index + 1})")
    texts = [cell.get_attribute("data-sort") for cell in cells]
    return [None if text is None else float(text) for text in texts]


def heading(table, title: str):
    buttons = table.find_elements(By.CSS_SELECTOR, "thead button")
    titles = [button.text.replace("\n", " ") for button in buttons]
    index = next(i for i, text in enumerate(titles) if title in text)
    return index, buttons[index]


def test_a_pressed_heading_sorts_and_pressed_again_turns_round(browser, page):
    table = visible_table(browser)
    index, button = heading(table, "Windows")
    button.click()
    rising = column(table, index)
    numbers = [value for value in rising if value is not None]
    assert len(numbers) == 3 and numbers == sorted(numbers)
    assert rising[-2:] == [None, None]  # the model without windows, and the scatter
    assert button.find_element(By.XPATH, "..").get_attribute("aria-sort") == "ascending"
    button.click()
    falling = column(table, index)
    assert falling == [*reversed(numbers), None, None]
    names = [cell.get_attribute("data-sort") for cell in
             table.find_elements(By.CSS_SELECTOR, "tbody th")]  # fmt: skip
    heading(table, "Model")[1].click()
    by_name = [cell.get_attribute("data-sort") for cell in
               table.find_elements(By.CSS_SELECTOR, "tbody th")]  # fmt: skip
    assert by_name == sorted(names) != names
    assert len(table.find_elements(By.CSS_SELECTOR, "th[aria-sort]")) == 1


def test_the_page_opens_with_the_best_whole_path_model_first(browser, page):
    table = visible_table(browser)
    index, button = heading(table, "Whole-path")
    values = column(table, index)
    assert values == sorted(values) and None not in values
    assert button.find_element(By.XPATH, "..").get_attribute("aria-sort") == "ascending"


def test_split_and_score_are_chosen(browser, page):
    before = visible_table(browser).get_attribute("aria-label")
    assert before == "Stress MSE, split test"
    browser.find_element(By.CSS_SELECTOR, "input[value='ood-psd']").click()
    Select(browser.find_element(By.NAME, "metric")).select_by_visible_text("Error points")
    assert visible_table(browser).get_attribute("aria-label") == "Error points, split ood-psd"
    charts = browser.find_elements(By.CSS_SELECTOR, ".charts svg")
    shown = [chart.get_attribute("aria-label") for chart in charts if chart.is_displayed()]
    assert len(shown) == 5 and all("ood-psd" in label for label in shown)


def test_the_keyboard_suffices(browser, page):
    table = visible_table(browser)
    index, button = heading(table, "Single step")
    browser.execute_script("arguments[0].focus()", button)
    webdriver.ActionChains(browser).send_keys(" ").perform()
    numbers = [value for value in column(table, index) if value is not None]
    assert numbers == sorted(numbers)


def test_nothing_is_fetched_and_nothing_fails(browser, page):
    fetched = browser.execute_script(
        "return performance.getEntriesByType('resource').map(entry => entry.name)"
    )
    assert all(name.startswith(("file:", "data:")) for name in fetched)
    assert browser.get_log("browser") == []
    width = browser.execute_script("return document.documentElement.scrollWidth")
    assert width <= 1280
    for table in browser.find_elements(By.CSS_SELECTOR, ".scroll"):
        assert table.get_property("scrollWidth") <= table.get_property("clientWidth") + 1
