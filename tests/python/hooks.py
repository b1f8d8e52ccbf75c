"""What schemathesis must be told of meshsnap: meshes to send, and the rules that a schema cannot express."""

import os
import re

import schemathesis
from hypothesis import strategies as st
from schemathesis.checks import CHECKS
from schemathesis.specs.openapi import checks

# Arbitrary bytes are no mesh: they are a 415 by design, which says nothing about the rest of a request.
MESHES = [
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
]
schemathesis.openapi.format("binary", st.sampled_from(MESHES))

# What the document allows as an address of a webhook goes to the receiver of the test, and to nobody else's machine.
PORT = r"(:(6553[0-5]|655[0-2][0-9]|65[0-4][0-9]{2}|6[0-4][0-9]{3}|[1-5][0-9]{4}|[1-9][0-9]{0,3}))?"
ADDRESS = re.compile(rf"^https?://[A-Za-z0-9.-]+{PORT}(/[A-Za-z0-9/._~-]*)?\Z")


@schemathesis.hook
def before_call(context, case, kwargs):
    if case.headers and ADDRESS.match(str(case.headers.get("Webhook", ""))):
        case.headers["Webhook"] = os.environ["WEBHOOK_RECEIVER"]


# Answers to requests that the document allows and meshsnap refuses, by code and a part of the detail. Each is a rule
# between values, which a schema cannot express.
RULES_BETWEEN_VALUES = [
    ("bad_form", "two files are named"),  # schemathesis gives all parts one name
    ("conflicting_keys", ""),  # a short name and its key; keys that exclude each other
    ("digest_mismatch", ""),  # the SHA-256 in the path is that of the body
    ("entry_unclear", ""),  # `entry` names a file of what was sent
    ("idempotency_key_reused", ""),  # an Idempotency-Key belongs to one request
    ("not_acceptable", ""),  # `Accept` allows a format of pictures
    ("out_of_range", " where `"),  # a range that depends on another key of the same layer or of the document
    ("out_of_range", "frames have at most"),  # the pixels of all frames together
    ("out_of_range", "cells"),  # the pixels of each cell of a sheet
]


# Rules (`rules=bounds:1,2,3`) and the keys of a difference's picture are words that the schema does not list; jobs of these
# kinds take the keys of these paths.
WORDS_OF_THEIR_OWN = ["/v1/check", "/v1/diff"]


def is_rule_between_values(response, case):
    """True for the problem documents of these rules."""
    if response.status_code == 422 and case.path in WORDS_OF_THEIR_OWN:
        return True  # with `fail=422`, a verdict
    if response.headers.get("content-type") != ["application/problem+json"]:
        return False
    if case.path.endswith("/result"):
        return True  # the error of the job, which was accepted before its mesh was read
    if case.path in WORDS_OF_THEIR_OWN or (case.query or {}).get("kind") in ("check", "diff"):
        return True
    problem = response.json()
    if problem["code"] == "bad_webhook" and not ADDRESS.match(str((case.headers or {}).get("Webhook", ""))):
        return True  # of the shortest text of a header, schemathesis forgets the pattern
    if problem["code"] == "mesh_broken" and "format_in" in (case.query or {}):
        return True  # `format_in` is the format of what was sent
    return any(problem["code"] == code and part in problem["detail"] for code, part in RULES_BETWEEN_VALUES)


accepts_positive, rejects_negative = checks.positive_data_acceptance, checks.negative_data_rejection
finds_deleted = checks.use_after_free
for replaced in (accepts_positive, rejects_negative, finds_deleted):
    CHECKS.unregister(replaced.__name__)


@schemathesis.check
def positive_data_acceptance(ctx, response, case):
    """The built-in check, without the rules between values."""
    if is_rule_between_values(response, case):
        return None
    return accepts_positive(ctx, response, case)


@schemathesis.check
def negative_data_rejection(ctx, response, case):
    """The built-in check, without bodies that the type of the body does not decide about.

    A body is read as a mesh whatever its Content-Type, where it is no JSON object or `format_in` says so, and POST /v1/jobs
    answers 202 before the mesh is read. POST /v1/check has a verdict on bytes that are no mesh, too.
    """
    is_verdict = response.status_code == 200 and case.path == "/v1/check"
    is_of_job = response.status_code == 202 and case.method == "POST" or is_verdict
    may_be_mesh = not isinstance(case.body, dict) or "format_in" in (case.query or {})
    if is_of_job and case.media_type == "application/json" and may_be_mesh:
        return None
    return rejects_negative(ctx, response, case)


@schemathesis.check
def use_after_free(ctx, response, case):
    """The built-in check, without cancelled jobs: DELETE of a job that has not ended cancels it, and its state stays."""
    if response.status_code in (200, 409) and case.path.startswith("/v1/jobs/"):
        return None
    return finds_deleted(ctx, response, case)
