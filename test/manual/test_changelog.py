# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Fragments of the changelog: those that are there are well formed, a bad one is refused, a section has each of them once."""

from __future__ import annotations

from pathlib import Path

import changelog
import pytest

PAGE = "# Changelog\n\nIts form.\n\n## 0.1.0 - 2026-01-01\n\n### Added\n\n- All.\n"


def write(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize("fragment", sorted(changelog.FRAGMENTS.glob("*")), ids=lambda file: file.name)
def test_fragments_are_well_formed(fragment: Path) -> None:
    assert list(changelog.faults(fragment)) == []


@pytest.mark.parametrize(
    "name, text, fault",
    [
        ("tank.new.txt", "A tank.\n", "KIND is one of added, changed"),
        ("Tank.added.txt", "A tank.\n", "small letters"),
        ("tank.added.md", "A tank.\n", "not NAME.KIND.txt"),
        ("tank.added.txt", "A tank\n", "full stop"),
        ("tank.added.txt", "\n", "full stop"),
        ("tank.added.txt", "- A tank.\n", "bullet"),
        ("tank.added.txt", "A tank.\n\nA pump.\n", "more than a paragraph"),
        ("tank.added.txt", "A" * 151 + ".\n", "break it"),
    ],
)
def test_a_bad_fragment_is_refused(name: str, text: str, fault: str, tmp_path: Path) -> None:
    assert fault in "\n".join(changelog.faults(write(tmp_path, name, text)))


def test_a_release_is_the_first_section(tmp_path: Path) -> None:
    fragments = [write(tmp_path, "pump.fixed.txt", "A pump\nruns dry.\n"), write(tmp_path, "tank.added.txt", "A tank.\n")]
    new = changelog.section(fragments, "0.2.0", "2026-02-01")
    assert new == "## 0.2.0 - 2026-02-01\n\n### Added\n\n- A tank.\n\n### Fixed\n\n- A pump\n  runs dry.\n"
    page = changelog.released(PAGE, fragments, "0.2.0", "2026-02-01")
    assert page.index("## 0.2.0") < page.index("## 0.1.0") and page.replace(new + "\n", "") == PAGE


def test_a_section_that_is_marked_as_unreleased_is_dated(tmp_path: Path) -> None:
    fragments = [write(tmp_path, "pump.fixed.txt", "A pump.\n"), write(tmp_path, "tank.added.txt", "A tank.\n")]
    begun = PAGE.replace("2026-01-01", "unreleased") + "\n## 0.0.9 - 2025-01-01\n\n### Added\n\n- Some.\n"
    page = changelog.released(begun, fragments, "0.1.0", "2026-02-01")
    assert page.startswith(
        "# Changelog\n\nIts form.\n\n## 0.1.0 - 2026-02-01\n\n### Added\n\n- A tank.\n- All.\n\n### Fixed\n\n- A pump.\n\n## 0.0.9"
    )
    assert "unreleased" not in page
