#!/usr/bin/python3
"""test_view_server.py INSITU_VIEW FOLDER: what insitu-view serves, saves and refuses, asked by http.client; and what it
writes to a terminal. No browser and no run: the files are made here."""
import base64
import http.client
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import stat
import subprocess
import sys
import time

from view_process import View

program, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
PNG = base64.b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==")
NAME = "a, b #1%.png"
SECRET = "a secret"


def make_files():
    shutil.rmtree(folder, ignore_errors=True)
    database = folder / "run.cdb"
    (database / "below").mkdir(parents=True)
    (database / "index.html").write_text("<p>the page</p>")
    (database / "data.js").write_text("cinemaTable([]);\n")
    (database / "data.csv").write_text(f'cycle,time,FILE\n0,0,old.png\n5,0.5,"{NAME}"\n')
    (database / NAME).write_bytes(PNG)
    (database / "below" / "b.png").write_bytes(PNG + b"b")
    (database / "notes.txt").write_text(SECRET)
    for name in ("secret.png", "secret.js", "scene.yaml"):
        (folder / name).write_text(SECRET)
    (database / "link.png").symlink_to(folder / "secret.png")
    (database / "here.png").symlink_to(NAME)
    (database / "out").symlink_to(folder)
    os.mkfifo(database / "pipe.png")
    (folder / "run.cdb2").mkdir()
    (folder / "run.cdb2" / "x.png").write_text(SECRET)
    (folder / "pressure.csv").write_text("cycle,time,cells,volume,minimum,maximum,mean,deviation\n"
                                         "0,0,8,1,-1,2,0.5,0.1\n5,0.5,8,1,-2,inf,0.25,0.1\n6,0.6,8,1,-3,4")
    (folder / "other.csv").write_text("password\nhunter2\n")
    (folder / "linked.csv").symlink_to(folder / "pressure.csv")


def ask(view, path, method="GET", body=None, **headers):
    """Status, headers and body of a request as it stands: http.client changes nothing of a path."""
    connection = http.client.HTTPConnection("127.0.0.1", view.port, timeout=10)
    connection.putrequest(method, path, skip_host=True)
    headers = {"Host": f"127.0.0.1:{view.port}", **{k.replace("_", "-"): v for k, v in headers.items()}}
    if body is not None and "Content-Length" not in headers:
        headers["Content-Length"] = str(len(body))
    for name, value in headers.items():
        if value is not None:
            connection.putheader(name, value)
    connection.endheaders()
    if body is not None:
        connection.send(body)
    answer = connection.getresponse()
    out = answer.status, answer.headers, answer.read()
    connection.close()
    return out


def refused(view, path, statuses=(403, 404), **others):
    status, _, body = ask(view, path, **others)
    assert status in statuses, (path, others, status, body)
    assert SECRET.encode() not in body and view.root.strip("/").encode() not in body, (path, body)


def the_database_is_served(view):
    root = view.root
    assert re.fullmatch(r"/[\w-]{22}/", root), root
    assert f"ssh -L {view.port}:127.0.0.1:{view.port} " in view.printed, view.printed
    for path, kind, expected in [("db/run.cdb/index.html", "text/html; charset=utf-8", b"<p>the page</p>"),
                                 ("db/run.cdb/data.js?123", "text/javascript; charset=utf-8", b"cinemaTable([]);\n"),
                                 ("db/run.cdb/a%2C%20b%20%231%25.png", "image/png", PNG), ("db/run.cdb/below/b.png", "image/png", PNG + b"b")]:
        status, headers, body = ask(view, root + path)
        assert (status, headers["Content-Type"], body) == (200, kind, expected), (path, status, body)
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Referrer-Policy"] == "no-referrer"
        assert headers["Content-Security-Policy"].startswith("sandbox ") and "same-origin" not in headers["Content-Security-Policy"]
        status, again, body = ask(view, root + path, method="HEAD")
        assert (status, again["Content-Length"], body) == (200, str(len(expected)), b""), path
        status, _, body = ask(view, root + path, If_None_Match=headers["ETag"])
        assert (status, body) == (304, b""), path
    status, headers, body = ask(view, root, Host=f"localhost:{view.port}")
    assert status == 200 and b"<title>insitu-view" in body and "default-src 'none'" in headers["Content-Security-Policy"]
    nonce = re.search(r"script-src 'nonce-([\w-]+)'", headers["Content-Security-Policy"]).group(1)
    assert body.count(f'nonce="{nonce}"'.encode()) == 2 and b"NONCE" not in body
    assert ask(view, root, Host="127.0.0.1:8000")[0] == 200  # by ssh -L from another port


def the_state_is_reported(view):
    state = json.loads(ask(view, view.root + "state")[2])
    assert state["database"] == "run.cdb" and state["has_page"] and state["report"] is None
    assert state["scene"]["path"] == "scene.yaml"
    table, = state["statistics"]  # not the link, and nothing of a file with other columns
    assert table["name"] == "pressure.csv" and table["lines"] == 2, table
    assert [row[4:7] for row in table["rows"]] == [[-1, 2, 0.5], [-2, None, 0.25]], table
    (folder / "run.cdb" / "report.json").write_text('{"cycle": 5, "warnings": []}')
    assert json.loads(ask(view, view.root + "state")[2])["report"] == {"cycle": 5, "warnings": []}
    (folder / "run.cdb" / "report.json").write_text('[1, torn')
    assert json.loads(ask(view, view.root + "state")[2])["report"] is None


def others_are_refused(view):
    root, own = view.root, f"127.0.0.1:{view.port}"
    wrong = root[:-2] + ("A" if root[-2] != "A" else "B") + "/"
    for path in ("/", "/state", "/db/index.html", wrong, wrong + "state", wrong + "db/run.cdb/data.js", root[:-2] + "/", "//state",
                 "/favicon.ico", "http://" + own + root, "*", "/%00/", "/%e9/"):
        refused(view, path, statuses=(403,))
    for host in ("evil.example", f"evil.example:{view.port}", f"127.0.0.1.evil.example:{view.port}", "127.0.0.1:1@evil.example",
                 "localhost.evil.example", f"10.0.0.1:{view.port}", "", None):
        refused(view, root, statuses=(403,), Host=host)
        refused(view, root + "state", statuses=(403,), Host=host)


def what_is_outside_is_refused(view):
    root = view.root
    for path in ("db/run.cdb/../secret.png", "db/run.cdb/%2e%2e/secret.png", "db/run.cdb/..%2fsecret.png", "db/run.cdb/%2e%2e%2fsecret.png", "db/run.cdb/./data.js",
                 "db/run.cdb//data.js", "db/run.cdb/below/../../secret.js", "db/run.cdb/below/%2e%2e/data.js", "db/run.cdb/%2f" + str(folder)[1:] + "/secret.png",
                 "db/run.cdb/" + str(folder) + "/secret.png", "db/run.cdb/link.png", "db/run.cdb/here.png", "db/run.cdb/out/secret.png", "db/run.cdb/out/run.cdb/data.js",
                 "db/run.cdb/pipe.png", "db", "db/run.cdb/", "db/run.cdb/below", "db/run.cdb/below/", "db/run.cdb/notes.txt", "db/run.cdb/data", "db/run.cdb/none.png", "db/run.cdb/a\\..\\secret.png",
                 "db/run.cdb/secret.png%00.png", "db/run.cdb/%00", "db/run.cdb/%ff.png", "db/run.cdb/" + 300 * "a" + ".png", "../scene", "secret.png", "scene.yaml", "%73tate2",
                 "db2/x.png", "db/../run.cdb2/x.png", "db/run.cdb2/x.png", "db/../db/run.cdb/data.js", "db/data.js", "other.csv", "pressure.csv"):
        refused(view, root + path, statuses=(404,))


def only_get_head_and_post_of_the_scene_are_taken(view):
    for method in ("PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT"):
        status, _, body = ask(view, view.root + "scene", method=method, body=b"x")
        assert status == 501 and SECRET.encode() not in body, (method, status)
    body = json.dumps({"text": "x", "stamp": "0"}).encode()
    for path in ("", "state", "db/run.cdb/data.js", "db/run.cdb/new.png", "scene/", "scene/x"):
        refused(view, view.root + path, statuses=(404,), method="POST", body=body, Content_Type="application/json")
    assert (folder / "scene.yaml").read_text() == SECRET and not (folder / "run.cdb" / "new.png").exists()


def post(view, what, statuses=(200,), **headers):
    body = what if isinstance(what, bytes) else json.dumps(what).encode()
    status, _, answer = ask(view, view.root + "scene", method="POST", body=body, **{"Content_Type": "application/json", **headers})
    assert status in statuses, (what[:80] if isinstance(what, bytes) else what, headers, status, answer)
    return json.loads(answer)


def the_scene_is_saved_whole(view):
    scene, real, own = folder / "scene.yaml", folder / "real.yaml", f"http://127.0.0.1:{view.port}"
    read = json.loads(ask(view, view.root + "scene")[2])
    assert read["text"] == SECRET
    scene.chmod(0o640)
    before = scene.stat().st_ino
    saved = post(view, {"text": "größer: 1\n", "stamp": read["stamp"]}, Origin=own)
    assert scene.read_text() == "größer: 1\n" and scene.stat().st_ino != before  # a new file in the old one's place
    assert stat.S_IMODE(scene.stat().st_mode) == 0o640
    assert saved["stamp"] == json.loads(ask(view, view.root + "scene")[2])["stamp"]
    post(view, {"text": "lost", "stamp": read["stamp"]}, statuses=(409,))
    for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": f"https://127.0.0.1:{view.port}"},
                    {"Origin": f"http://127.0.0.1:{view.port + 1}"}, {"Origin": own + ".evil.example"},
                    {"Origin": own, "Host": "evil.example"}):
        post(view, {"text": "lost", "stamp": saved["stamp"]}, statuses=(403,), **headers)
    for body, status in [(b"", 400), (b"{", 400), (b"[]", 400), (b'{"text": 1, "stamp": "0"}', 400), (b'{"text": "x"}', 400),
                         (b'{"text": "\\ud800", "stamp": "0"}', 400), (b"\xff", 400), (b"7", 400),
                         (json.dumps({"text": "x" * (1 << 20) + "y", "stamp": "0"}).encode(), 413)]:
        post(view, body, statuses=(status,))
    post(view, {"text": "lost", "stamp": saved["stamp"]}, statuses=(415,), Content_Type="text/plain")
    post(view, b"x", statuses=(413,), Content_Length=str(7 << 20))
    for length in ("-1", "1e3", "", "99999999999999999999"):
        post(view, b"x", statuses=(411,), Content_Length=length)
    post(view, b"5\r\nhello\r\n0\r\n\r\n", statuses=(411,), Transfer_Encoding="chunked")
    assert scene.read_text() == "größer: 1\n" and not list(folder.glob("scene.yaml.*"))
    scene.rename(real)
    post(view, {"text": "x", "stamp": saved["stamp"]}, statuses=(409,))  # it was taken away
    assert ask(view, view.root + "scene")[0] == 500
    real.rename(scene)


def a_link_to_the_scene_stays(view):
    real, text = folder / "scene.yaml", "linked: 1\n"
    with View(program, "run.cdb", "--scene", "link.yaml", folder=folder) as linked:
        stamp = json.loads(ask(linked, linked.root + "scene")[2])["stamp"]
        post(linked, {"text": text, "stamp": stamp})
    assert (folder / "link.yaml").is_symlink() and real.read_text() == text
    with View(program, "run.cdb", folder=folder) as blind:
        assert ask(blind, blind.root + "scene")[0] == 404 and "scene" not in json.loads(ask(blind, blind.root + "state")[2])
        post(blind, {"text": "x", "stamp": stamp}, statuses=(404,))
        refused(view, blind.root, statuses=(403,))  # each has a token of its own
    assert real.read_text() == text


def connections_are_bounded(view):
    held = [socket.create_connection(("127.0.0.1", view.port)) for _ in range(70)]
    time.sleep(0.3)
    held[-1].settimeout(5)
    assert held[-1].recv(1) == b"", "one beyond 64 is closed"
    for one in held:
        one.close()
    end = time.monotonic() + 10
    while True:
        try:
            assert ask(view, view.root + "state")[0] == 200
            return
        except (ConnectionError, http.client.BadStatusLine):
            assert time.monotonic() < end
            time.sleep(0.1)


def decoded(protocol, written):
    """The PNGs in what was written to a terminal, as its protocol has them."""
    if protocol == "iterm2":
        return [base64.b64decode(text) for text in re.findall(rb"\x1b\]1337;File=inline=1;size=\d+;width=auto:([^\x07]*)\x07", written)]
    out = []
    for keys, text in re.findall(rb"\x1b_G([^;]*);([^\x1b]*)\x1b\\", written):
        assert len(text) <= 4096, "kitty takes no longer pieces"
        if b"a=T" in keys:
            assert b"f=100" in keys
            out.append(b"")
        out[-1] += text
        assert (b"m=1" in keys) == (len(text) == 4096), keys
    return [base64.b64decode(text) for text in out]


def terminals_get_each_new_picture():
    large = PNG + bytes(10000)
    (folder / "run.cdb" / "data.csv").write_text(f'cycle,time,FILE\n0,0,old.png\n5,0.5,"{NAME}"\n')
    environments = [("kitty", {"TERM": "xterm-kitty"}), ("iterm2", {"TERM_PROGRAM": "iTerm.app", "TERM": "xterm-256color"})]
    running = []
    for protocol, environment in environments:
        with open(folder / protocol, "wb") as out:
            running.append(subprocess.Popen([sys.executable, program, "run.cdb", "--terminal"], cwd=folder, stdout=out,
                                            env={**{k: v for k, v in os.environ.items() if "TERM" not in k}, **environment}))
    wait_for(lambda: all(decoded(p, (folder / p).read_bytes()) == [PNG] for p, _ in environments))
    (folder / "run.cdb" / "new.png").write_bytes(large)
    with open(folder / "run.cdb" / "data.csv", "a") as table:
        table.write("6,0.6,new.png\n7,0.7,deep.exr\n8,0.8,to")
    wait_for(lambda: all(decoded(p, (folder / p).read_bytes()) == [PNG, large] for p, _ in environments))
    for process in running:
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0


def wait_for(holds, seconds=10):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it takes too long"
        time.sleep(0.05)


def wrong_options_are_reported():
    environment = {**{k: v for k, v in os.environ.items() if "TERM" not in k}, "TERM": "dumb"}
    for arguments, words in [(["run.cdb", "--terminal"], "not known to show pictures (TERM is dumb)"), ([], "DATABASE"),
                             (["scene.yaml"], "scene.yaml is no folder"), (["run.cdb", "--port", "70000"], "is 70000"),
                             (["run.cdb", "--scene", "none.yaml"], "none.yaml cannot be read: No such file"),
                             (["run.cdb", "--scene", ""], "cannot be read"),
                             (["run.cdb", "--protocol", "kitty"], "--protocol is of --terminal"),
                             (["run.cdb", "--terminal", "--port", "5"], "expected it without --scene and --port")]:
        done = subprocess.run([sys.executable, program, *arguments], cwd=folder, env=environment, text=True, timeout=20,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        assert done.returncode != 0 and words in " ".join(done.stdout.split()) and "Traceback" not in done.stdout, (arguments, done.stdout)


def main():
    # A test that a shell runs in the background inherits that SIGINT is ignored, and its children would too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    make_files()
    (folder / "link.yaml").symlink_to("scene.yaml")
    with View(program, "run.cdb", "--scene", "scene.yaml", folder=folder) as view:
        for test in (the_database_is_served, the_state_is_reported, others_are_refused, what_is_outside_is_refused,
                     only_get_head_and_post_of_the_scene_are_taken, the_scene_is_saved_whole, a_link_to_the_scene_stays,
                     connections_are_bounded):
            test(view)
            print(test.__name__, "is so", flush=True)
    for test in (terminals_get_each_new_picture, wrong_options_are_reported):
        test()
        print(test.__name__, "is so", flush=True)


main()
