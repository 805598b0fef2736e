"""The files of the pages, from memory."""

import json
from functools import partial
from importlib import resources

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from gateway.languages import read_texts

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


def static_routes(page: str, language: str) -> list[Route]:
    """Return the routes of all files, and of a module with the texts of a language; `page` is the one at `/`."""
    texts = f"export const LANGUAGE = {json.dumps(language)}, TEXTS = {json.dumps(read_texts(language))};\n"
    routes = [Route("/language.js", partial(_serve_file, texts.encode(), TYPES[".js"]))]
    for file in resources.files("gateway.page").joinpath("static").iterdir():
        media_type = TYPES["." + file.name.rpartition(".")[2]]
        is_page = file.name.endswith(".html")
        if file.name == page or not is_page:
            path = "/" if is_page else f"/{file.name}"
            routes.append(Route(path, partial(_serve_file, file.read_bytes(), media_type)))
    return routes


async def _serve_file(content: bytes, media_type: str, _request: Request) -> Response:
    return Response(content, media_type=media_type)
