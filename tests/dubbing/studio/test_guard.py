"""Whom the server of the page lets in, and which requests it takes."""

from __future__ import annotations

from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.dubbing.studio.stand_in import DUB, FIRST, TOKEN, client_of

pytestmark = pytest.mark.medium


def test_nobody_without_the_token_sees_anything(stranger: TestClient) -> None:
    for path in ("/", "/?token=guess", "/page/main.js", "/api/dubs", f"{DUB}/sound", "/nothing"):
        answer = stranger.get(path)
        assert (answer.status_code, "printed" in answer.text) == (401, True), path
    opened = stranger.get(f"/?token={TOKEN}")
    assert opened.headers["location"] == "/"
    cookie = opened.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert TOKEN not in cookie
    assert stranger.get("/api/dubs").json() == {"dubs": ["it"], "lacking": {}}


@pytest.mark.parametrize(
    ("headers", "code"),
    [
        ({"host": "evil.example:8711"}, 421),
        ({"host": "10.0.0.1:8711"}, 421),
        ({"host": ""}, 421),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "http://127.0.0.1:9999"}, 403),
        ({"origin": "null"}, 403),
        ({"host": "[::1"}, 400),
        ({"host": "[nobody]"}, 400),
        ({"origin": "http://[::1"}, 400),
        ({"content-length": "1" * 5000}, 400),
    ],
)
def test_other_pages_and_other_names_are_refused(
    client: TestClient, headers: dict[str, str], code: int
) -> None:
    assert client.get(DUB, headers=headers).status_code == code
    answer = client.put(f"{DUB}/lines/{FIRST}", json={}, headers=headers)
    assert answer.status_code == code
    assert answer.text.endswith(".")


def test_what_changes_something_must_say_where_it_comes_from(client: TestClient) -> None:
    del client.headers["origin"]
    assert client.get(DUB).status_code == 200  # a browser sends none with an address
    assert client.put(f"{DUB}/lines/{FIRST}", json={}).status_code == 403


def test_only_the_files_of_the_page_are_served(client: TestClient) -> None:
    assert "<title>dfrf studio</title>" in client.get("/").text
    policy = client.get("/page/main.js").headers["content-security-policy"]
    assert "default-src 'self'" in policy
    for path in ("../guard.py", "%2e%2e/guard.py", "..%2fguard.py", "/etc/passwd", "../../m.yaml"):
        assert client.get(f"/page/{path}").status_code == 404, path
    for path in ("/m.yaml", "/api/dubs/%2e%2e", "/api/dubs/..%2f..%2fm.yaml", "/api/dubs/other"):
        assert client.get(path).status_code == 404, path
    assert client.get("/api/dubs/other").json()["error"] == "the manifest has no dub 'other'"


def test_a_password_is_asked_for_where_others_can_reach_it(manifest: Path) -> None:
    with client_of(manifest, password=True, host="0.0.0.0") as client:
        there = {"host": "10.1.2.3:8711", "origin": "http://10.1.2.3:8711"}
        assert client.get(f"/?token={TOKEN}", headers=there).status_code == 401
        assert 'type="password"' in client.get("/", headers=there).text
        assert client.post("/login", data={"password": "no"}, headers=there).status_code == 401
        assert client.get(DUB, headers=there).status_code == 401
        assert client.get("/", headers={"host": "evil.example"}).status_code == 421
        assert client.post("/login", data={"password": TOKEN}, headers=there).status_code == 303
        assert client.post("/login", data={"password": TOKEN}).status_code == 303
        assert client.get(DUB).status_code == 200
