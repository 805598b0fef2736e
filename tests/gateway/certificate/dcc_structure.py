"""The structure of a digital calibration certificate by the documentation of PTB's schema 3.2.0, for the elements in use.

Element: its children in order, each with `!` (exactly one), `?` (at most one), `+` (one or more) or `*` (any number). What is not
listed contains text. The schema itself is under the LGPL and is not copied here; `docs/guides/service/certificate.md` says how a
document is validated by it.
"""

import re
from xml.etree.ElementTree import Element

NAMESPACES = {"{https://ptb.de/dcc}": "", "{https://ptb.de/si}": "si:"}
TEXT = "content+"
LISTS = {
    "digitalCalibrationCertificate": "administrativeData! measurementResults! comment? document?",
    "administrativeData": "dccSoftware! refTypeDefinitions? coreData! items! calibrationLaboratory! respPersons! customer! "
    "statements?",
    "dccSoftware": "software+",
    "usedSoftware": "software+",
    "software": "name! release! type? description?",
    "coreData": "countryCodeISO3166_1! usedLangCodeISO639_1+ mandatoryLangCodeISO639_1+ uniqueIdentifier! identifications? "
    "receiptDate? beginPerformanceDate! endPerformanceDate! performanceLocation! issueDate? previousReport?",
    "items": "name? equipmentClass* description? owner? identifications? item+",
    "item": "name! equipmentClass* description? installedSoftwares? manufacturer! model? identifications! itemQuantities?",
    "manufacturer": "name! eMail? phone? fax? location?",
    "person": "name! eMail? phone? fax? location?",
    "contact": "name! eMail? phone? fax? location!",
    "customer": "name! eMail? phone? fax? location!",
    "location": "further+",
    "identifications": "identification+",
    "identification": "issuer! value! name?",
    "calibrationLaboratory": "calibrationLaboratoryCode? contact!",
    "respPersons": "respPerson+",
    "respPerson": "person! description? role? mainSigner?",
    "statements": "statement+",
    "statement": "name? description? countryCodeISO3166_1* convention? traceable? norm* reference* declaration? date?",
    "measurementResults": "measurementResult+",
    "measurementResult": "name! description? usedMethods? usedSoftware? measuringEquipments? influenceConditions? results!",
    "usedMethods": "usedMethod+",
    "usedMethod": "name! description? norm* reference*",
    "measuringEquipments": "name? measuringEquipment+",
    "measuringEquipment": "name! equipmentClass* description? certificate? manufacturer?",
    "influenceConditions": "influenceCondition+",
    "influenceCondition": "name! description? status? certificate? data!",
    "results": "result+",
    "result": "name! description? data!",
    "data": "text* quantity* list*",
    "list": "name? description? dateTime? quantity+",
    "quantity": "name? description? si:real!",
    "si:real": "si:label? si:value! si:unit! si:dateTime? si:expandedUnc?",
    "si:expandedUnc": "si:uncertainty! si:coverageFactor! si:coverageProbability! si:distribution?",
    **dict.fromkeys(("name", "description", "declaration", "further"), TEXT),
}
COUNTS = {"!": "", "?": "?", "+": "+", "*": "*"}
DECIMAL = r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?"
TEXTS = {
    "countryCodeISO3166_1": "[A-Z]{2}",
    "usedLangCodeISO639_1": "[a-z]{2}",
    "mandatoryLangCodeISO639_1": "[a-z]{2}",
    "beginPerformanceDate": r"\d{4}-\d\d-\d\d",
    "endPerformanceDate": r"\d{4}-\d\d-\d\d",
    "performanceLocation": "laboratory|customer|laboratoryBranch|customerBranch|other",
    "issuer": "manufacturer|calibrationLaboratory|customer|owner|other",
    "si:value": DECIMAL,
    "si:uncertainty": DECIMAL.removeprefix("[-+]?"),
    "si:coverageFactor": r"[1-9](\.\d+)?",
    "si:coverageProbability": r"0?\.\d+",
    "si:unit": r"(\\[a-z]+(\{-?\d+\})?)+",
}
NOT_EMPTY = r"\S+(\s+\S+)*"


def find_problems(element: Element) -> list[str]:
    """Return where an element and what is in it differ from the structure."""
    name = _name(element)
    if name not in LISTS:
        said = element.text or ("x" if name == "content" else "")
        return [] if re.fullmatch(TEXTS.get(name, NOT_EMPTY), said) and not len(element) else [f"{name}: {said!r}"]
    pattern = "".join(f"(<{part[:-1]}>){COUNTS[part[-1]]}" for part in LISTS[name].split())
    found = "".join(f"<{_name(child)}>" for child in element)
    own = [] if found and re.fullmatch(pattern, found) else [f"{name}: has {found}"]
    return own + [problem for child in element for problem in find_problems(child)]


def _name(element: Element) -> str:
    namespace, _, local = element.tag.rpartition("}")
    return NAMESPACES[namespace + "}"] + local
