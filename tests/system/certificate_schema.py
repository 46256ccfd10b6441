"""The order of the elements of a certificate, and the form of their texts. Standard library only."""
import re

from certificate_check import SPACES

# The order of children in dcc.xsd 3.3.0 and SI_Format.xsd 2.2.1 of PTB. `*`: one or more, `?`: may be absent, `|`: one of these.
# Elements of the schemas that are not written are left out, so that they count as faults.
ORDER = {
    "dcc:digitalCalibrationCertificate": "administrativeData measurementResults",
    "dcc:administrativeData": "dccSoftware coreData items calibrationLaboratory respPersons customer statements?",
    "dcc:dccSoftware": "software*",
    "dcc:software": "name release",
    "dcc:coreData": "countryCodeISO3166_1 usedLangCodeISO639_1* mandatoryLangCodeISO639_1* uniqueIdentifier beginPerformanceDate "
                    "endPerformanceDate performanceLocation issueDate?",
    "dcc:items": "item*",
    "dcc:item": "name description? identifications",
    "dcc:identifications": "identification*",
    "dcc:identification": "issuer value name?",
    "dcc:calibrationLaboratory": "contact",
    "dcc:contact": "name location",
    "dcc:customer": "name location",
    "dcc:location": "countryCode|further",
    "dcc:respPersons": "respPerson*",
    "dcc:respPerson": "person",
    "dcc:person": "name",
    "dcc:statements": "statement*",
    "dcc:statement": "name? declaration?",
    "dcc:measurementResults": "usedMethods? measuringEquipments? influenceConditions? measurementMetaData? measurementResult*",
    "dcc:usedMethods": "usedMethod*",
    "dcc:usedMethod": "name reference*",
    "dcc:measuringEquipments": "measuringEquipment*",
    "dcc:measuringEquipment": "name measuringEquipmentQuantities?",
    "dcc:measuringEquipmentQuantities": "measuringEquipmentQuantity*",
    "dcc:measuringEquipmentQuantity": "name? real",
    "dcc:influenceConditions": "influenceCondition*",
    "dcc:influenceCondition": "name data",
    "dcc:measurementMetaData": "metaData*",
    "dcc:metaData": "name? data?",
    "dcc:measurementResult": "name description? results",
    "dcc:results": "result*",
    "dcc:result": "name data",
    "dcc:data": "text|quantity*",
    "dcc:quantity": "name? noQuantity|real|realListXMLList",
    "si:real": "value unit measurementUncertaintyUnivariate?",
    "si:measurementUncertaintyUnivariate": "expandedMU",
    "si:expandedMU": "valueExpandedMU coverageFactor coverageProbability distribution?",
    "si:realListXMLList": "valueXMLList unitXMLList measurementUncertaintyUnivariateXMLList?",
    "si:measurementUncertaintyUnivariateXMLList": "expandedMUXMLList",
    "si:expandedMUXMLList": "valueExpandedMUXMLList coverageFactorXMLList coverageProbabilityXMLList distributionXMLList?",
    **{f"dcc:{name}": "content*" for name in ("name", "description", "declaration", "further", "text", "noQuantity")},
}
SHAPES = {  # texts of elements
    "dcc:countryCodeISO3166_1": "[A-Z]{2}", "dcc:countryCode": "[A-Z]{2}", "dcc:usedLangCodeISO639_1": "[a-z]{2}",
    "dcc:mandatoryLangCodeISO639_1": "[a-z]{2}", "dcc:beginPerformanceDate": r"\d{4}-\d\d-\d\d",
    "dcc:endPerformanceDate": r"\d{4}-\d\d-\d\d", "dcc:issueDate": r"\d{4}-\d\d-\d\d",
    "dcc:performanceLocation": "laboratory|customer|laboratoryBranch|customerBranch|other",
    "dcc:issuer": "manufacturer|calibrationLaboratory|customer|owner|other",
    **{f"dcc:{name}": r"\S+(\s+\S+)*" for name in ("release", "uniqueIdentifier", "value", "reference")},
    **{f"si:{name}": r"[-+]?\d+(\.\d+)?([eE][-+]?\d+)?" for name in ("value", "valueExpandedMU", "coverageFactor", "coverageProbability")},
    **{f"si:{name}XMLList": r"([-+]?\d+(\.\d+)?([eE][-+]?\d+)?( |$))+" for name in ("value", "valueExpandedMU", "coverageFactor", "coverageProbability")},
    **{f"si:{name}": r"\\(newton|newton\\metre|percent|one|degreecelsius)" for name in ("unit", "unitXMLList")},
}


def name_of(element):
    return next(element.tag.replace(f"{{{uri}}}", f"{prefix}:") for prefix, uri in SPACES.items() if uri in element.tag)


def faults(element):
    """Yields where an element does not follow ORDER and SHAPES."""
    name, children = name_of(element), "".join(name_of(child).split(":")[1] + " " for child in element)
    parts = [(part.rstrip("*?"), {"*": "+", "?": "?"}.get(part[-1], "")) for part in ORDER.get(name, "").split()]
    if not re.fullmatch("".join(f"((?:{names}) ){times}" for names, times in parts), children):
        yield f"{name}: {children}"
    if name in SHAPES and not re.fullmatch(SHAPES[name], element.text or ""):
        yield f"{name}: {element.text!r}"
    for child in element:
        yield from faults(child)
