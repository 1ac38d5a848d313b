"""What mkdocs is told beside mkdocs.yml: the page made from the header, pages from outside of docs/, and links to them.

Pages link to files of the source tree where these stand, so that they can be followed in the tree and on a forge. On the
site such a file is a page that shows it.
"""
import pathlib
import posixpath
import sys
import tempfile

from mkdocs.structure.files import File

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.dont_write_bytecode = True
sys.path.insert(0, str(HERE))
import header_page  # noqa: E402
import markdown_pages  # noqa: E402

HEADERS = ["libinsitu/include/insitu/insitu.h", "libinsitu/include/insitu/status.h"]
MOVED = {"CONTRIBUTING.md": "contributing.md", "README.md": "README.md",
         **{header: "interface.md" for header in HEADERS}}
LANGUAGES = {".c": "c", ".h": "c", ".cpp": "cpp", ".f90": "fortran", ".py": "python", ".yaml": "yaml", ".sh": "sh",
             ".txt": "cmake", ".cmake": "cmake", ".csv": "text"}
_origins = {MOVED["CONTRIBUTING.md"]: "CONTRIBUTING.md"}


def _origin(src_path):
    return _origins.get(src_path, "docs/" + src_path)


def _place(path):
    """Where a file of the tree is on the site."""
    if path in MOVED:
        return MOVED[path]
    if path.startswith("docs/"):
        return path[len("docs/"):]
    return f"source/{path}.md"


def _source_page(path):
    at = ROOT / path
    if at.is_dir():
        names = sorted(p.name for p in at.iterdir() if p.is_file() and p.suffix in LANGUAGES)
        return f"# {path}\n\n" + "\n".join(f"- [{name}]({posixpath.basename(path)}/{name}.md)" for name in names)
    return f"# {path}\n\n```{LANGUAGES.get(at.suffix, 'text')}\n{at.read_text()}```\n"


def _linked_sources(texts):
    """Files and folders outside of docs/ that pages link to, and what is in those folders."""
    found = {markdown_pages.target_of(page, link)[0] for page, text in texts for link, _ in markdown_pages.links(text)}
    found = {path for path in found if (ROOT / path).exists() and _place(path).startswith("source/")}
    inside = {str(p.relative_to(ROOT)) for path in found for p in (ROOT / path).glob("*")
              if p.is_file() and p.suffix in LANGUAGES}
    return found | inside


def on_files(files, config):
    for file in list(files):
        if file.src_path.startswith("site/") and not file.src_path.endswith(".css"):
            files.remove(file)
    folder = pathlib.Path(tempfile.mkdtemp())
    config["insitu_folder"] = folder

    def add(place, text):
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_text(text)
        files.append(File(place, str(folder), config["site_dir"], config["use_directory_urls"]))

    add("interface.md", header_page.page([(ROOT / header).read_text() for header in HEADERS]))
    for place, name in _origins.items():
        add(place, (ROOT / name).read_text())
    texts = [(_origin(f.src_path), pathlib.Path(f.abs_src_path).read_text()) for f in files.documentation_pages()]
    for path in sorted(_linked_sources(texts)):
        add(_place(path), _source_page(path))
    return files


def on_page_markdown(markdown, page, config, files):
    """Each link leads to where its file is on the site."""
    src_path = page.file.src_path
    if src_path.startswith("source/") or src_path == "interface.md":
        return markdown
    for link, begin in reversed(list(markdown_pages.links(markdown))):
        path, anchor = markdown_pages.target_of(_origin(src_path), link)
        place = posixpath.relpath(_place(path), posixpath.dirname(src_path) or ".")
        new = "#" + anchor if link.startswith("#") else place + ("#" + anchor if anchor else "")
        markdown = markdown[:begin] + new + markdown[begin + len(link):]
    return markdown


def on_post_build(config):
    for path in sorted(config["insitu_folder"].rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    config["insitu_folder"].rmdir()
