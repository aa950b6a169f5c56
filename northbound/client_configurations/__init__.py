"""The register map as configurations of programs that read it: `positioner map --format NAME`.

Its files:

    register_readers                    which programs there are
    telegraf, modbus_exporter           one each
    home_assistant, node_red            one each
"""
