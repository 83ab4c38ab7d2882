"""The routes of the off-line desk: files come as they are, a body each, and are never held in memory."""

import asyncio
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

from fastapi import APIRouter, Depends, HTTPException, Path, Query, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse, StreamingResponse
from starlette.requests import ClientDisconnect

from faultbond.errors import FaultbondError, StoreError
from faultbond.service.contract.offline import (
    Desk,
    FileKind,
    JobOrder,
    JobResult,
    LargeFileError,
    TooManyError,
    TooSlowError,
    WrongKindError,
)
from faultbond.service.web.offline_shapes import FileShape, JobShape, OfflineShape, OrderShape
from faultbond.service.web.route_parts import Bounded, check_json, check_token, person_of, refusals, token_header
from faultbond.service.web.security import Guard, Person, Role
from faultbond.service.web.shapes import DoneShape, Readable
from faultbond.service.web.shield import REPORT_POLICY

BYTES = "application/octet-stream"
PORTION = 2**16  # bytes of a result that are sent at once
JobName = Annotated[str, Path(pattern="^[0-9a-f]{16}$", description="`id` of an analysis")]
STATUSES = ((WrongKindError, 415), (LargeFileError, 413), (TooSlowError, 408), (StoreError, 503), (FaultbondError, 409))


class JsonLines(Response):
    """Records as the command line writes them."""

    media_type = "application/x-ndjson"


def offline_routes(desk: Desk, guard: Guard) -> APIRouter:
    """Give the routes; all of them are an engineer's, also those that only show."""
    router = APIRouter(prefix="/api/v1/offline", tags=["off line"], dependencies=[person_of(guard, Role.ENGINEER)])
    engineer = Annotated[Person, person_of(guard, Role.ENGINEER)]
    token_shown = Annotated[str | None, Depends(token_header)]
    seen, seen_of_one = refusals(401, 403), refusals(401, 403, 404, 422)

    @router.get("", response_model=OfflineShape, responses=seen)
    async def all_of_it() -> Response:
        """Tell limits, assets whose models may be taken, and analyses."""
        return JSONResponse({"now": time.time(), **desk.shown()})

    @router.post(
        "/files",
        status_code=201,
        response_model=FileShape,
        responses=refusals(400, 401, 403, 408, 409, 413, 415, 422, 429, 503),
        openapi_extra={
            "requestBody": {"required": True, "content": {BYTES: {"schema": {"type": "string", "format": "binary"}}}}
        },
    )
    async def bring(
        request: Request,
        name: Annotated[Readable, Query(min_length=1, max_length=200, description="Of the file; its ending counts")],
        kind: Annotated[FileKind, Query(description="What it is brought as")],
        person: engineer,
        token: token_shown,
    ) -> Response:
        """Bring a file, the body as it is; on the disk and in the audit when this answers, and kept for an hour."""
        check_token(person, token)
        if request.headers.get("content-type", "").partition(";")[0].strip().lower() != BYTES:
            raise HTTPException(415, f"Send the file as {BYTES}.")
        with _refusing("file"):
            return JSONResponse(await desk.take(name, kind, person.name, request.stream()), 201)

    orders = APIRouter(route_class=Bounded)

    @orders.post(
        "/jobs",
        status_code=201,
        response_model=JobShape,
        responses=refusals(400, 401, 403, 404, 409, 413, 415, 422, 429, 503),
        dependencies=[Depends(check_json)],
    )
    async def order(body: OrderShape, person: engineer, token: token_shown) -> Response:
        """Let an analysis wait for its turn; it takes the files that it names."""
        check_token(person, token)
        wanted = JobOrder(
            who=person.name,
            recording=body.recording,
            asset=body.asset or "",
            model=body.model or "",
            tables=tuple(body.tables),
            analyse=body.analyse,
        )
        with _refusing("file or asset"):
            return JSONResponse(await desk.order(wanted), 201)

    @orders.get("/jobs/{job}", response_model=JobShape, responses=seen_of_one)
    async def one(job: JobName) -> Response:
        """Tell of an analysis."""
        with _refusing("analysis"):
            return JSONResponse(desk.job(job))

    @orders.delete("/jobs/{job}", response_model=DoneShape, responses=refusals(401, 403, 404, 413, 422, 503))
    async def remove(job: JobName, person: engineer, token: token_shown) -> Response:
        """Stop an analysis where it waits or is at work, and remove it with its files."""
        check_token(person, token)
        with _refusing("analysis"):
            await desk.remove(job, person.name)
        return JSONResponse({"ok": True})

    @orders.get("/jobs/{job}/report", response_class=HTMLResponse, responses=seen_of_one)
    async def report(job: JobName) -> Response:
        """Give the report, a page in one file, as the command line writes it."""
        headers = {"content-security-policy": REPORT_POLICY}
        return await _file(desk, job, JobResult.REPORT, "text/html; charset=utf-8", headers)

    @orders.get("/jobs/{job}/records", response_class=JsonLines, responses=seen_of_one)
    async def records(job: JobName) -> Response:
        """Give the records, an object a line, as the command line writes them."""
        headers = {"content-disposition": f'attachment; filename="records-{job}.jsonl"'}
        return await _file(desk, job, JobResult.RECORDS, JsonLines.media_type, headers)

    @orders.get("/jobs/{job}/analysis", response_class=PlainTextResponse, responses=seen_of_one)
    async def analysis(job: JobName) -> Response:
        """Give what `analyse` said of the model."""
        return await _file(desk, job, JobResult.ANALYSIS, "text/plain; charset=utf-8", {})

    router.include_router(orders)
    return router


async def _file(desk: Desk, job: str, what: JobResult, media_type: str, headers: dict[str, str]) -> Response:
    """Give a result, a portion at a time."""
    with _refusing(what.value):
        try:
            stream = await asyncio.to_thread(desk.result(job, what).open, "rb")
        except FileNotFoundError:
            raise KeyError(job) from None

    def portions() -> Iterator[bytes]:
        with stream:
            while part := stream.read(PORTION):
                yield part

    size = os.fstat(stream.fileno()).st_size
    return StreamingResponse(portions(), media_type=media_type, headers={**headers, "content-length": str(size)})


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    """Refuse as HTTP does."""
    try:
        yield
    except KeyError:
        raise HTTPException(404, f"There is no such {what}.") from None
    except ClientDisconnect:
        raise HTTPException(400, "It was broken off.") from None  # to nobody, and no failure of the service
    except TooManyError as error:
        raise HTTPException(429, str(error), {"retry-after": f"{max(error.seconds, 1.0):.0f}"}) from None
    except FaultbondError as error:
        status = next(status for kind, status in STATUSES if isinstance(error, kind))
        raise HTTPException(status, str(error)) from None
