"""What the files of a diagnosis are called."""

JSON_NAME, MODEL_NAME, PAGE_NAME, FIGURE_NAME = (
    "diagnosis.json",
    "extended_model.yaml",
    "report.html",
    "where_it_is_wrong.png",
)
FILE_NAMES = (JSON_NAME, MODEL_NAME, PAGE_NAME, FIGURE_NAME)
