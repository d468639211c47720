"""The example at the end of each command's help: a command line that does something usual."""

from __future__ import annotations

# By the words after ``fomrc``. A test reads each as the command itself would.
EXAMPLES = {
    "simulate": "fomrc simulate --model model.yaml --input record.csv --output simulated.csv",
    "compensate": "fomrc compensate --model model.yaml --input target.csv --output voltage.csv --max-voltage 100",
    "export": "fomrc export --model model.yaml --output controller --rate 10000 --self-test",
    "identify": "fomrc identify staircase.csv --test triangle.csv --elements auto --output model.yaml",
    "identify-fleet": "fomrc identify-fleet recordings --output models",
    "identify-axes": "fomrc identify-axes record1.csv record2.csv --periods 2 --output stage.yaml",
    "check": "fomrc check record.csv --max-voltage 100",
    "diagnose": "fomrc diagnose staircase.csv --test triangle.csv --output diagnosis",
    "diagnose-fleet": "fomrc diagnose-fleet recordings --output reports",
    "watch": "fomrc watch monday.csv tuesday.csv --model model.yaml --output changes",
    "view": "fomrc view model.yaml record.csv --output look.html",
    "compare": "fomrc compare staircase.csv --test triangle.csv --models Preisach --output comparison",
    "reproduce": "fomrc reproduce --output paper",
    "benchmark": "fomrc benchmark fsm --train fsm --output mirror",
    "data": "fomrc data pea_1hz --output data",
    "import": "fomrc import scope.csv --units time=ms,voltage=15V,displacement=nm --output record.csv",
    "doctor": "fomrc doctor",
    "demo": "fomrc demo --output demo_output",
    "excite relax": "fomrc excite relax --amplitude 100 --output relax.csv",
    "excite triangle": "fomrc excite triangle --amplitude 100 --slope 50 --unipolar --output triangle.csv",
    "excite staircase": "fomrc excite staircase --amplitude 100 --step 10 --unipolar --output staircase.csv",
    "excite steps": "fomrc excite steps --levels 100,0,50,0 --dwell 30 --output steps.csv",
    "excite multisine": "fomrc excite multisine --amplitude 50 --offset 50 --highest 200 --output multisine.csv",
}


def example_of(name: str) -> str:
    """Return the end of the help of a command, such as ``identify`` or ``excite steps``."""
    # \b: the lines below are not filled up like a paragraph
    return f"\b\nExample:\n  {EXAMPLES[name]}"
